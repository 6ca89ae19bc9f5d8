//! The product's work from folder to folder: read, run, write the result and its page.

mod demo;
mod episode_run;
mod error;
mod inspect;
mod lift;
mod lifted;
pub mod moving;
pub mod pages;
pub mod paper;
pub mod phantoms;
mod recorder;
mod rendering;
pub mod replayed;
mod segment;
mod solvers;
pub mod specimen_scene;
pub mod truth;
mod workflow;

pub use demo::{Demo, DemoResult};
pub use episode_run::{EpisodeMade, EpisodeRun, read_episode, replay, sweep_files};
pub use error::{Error, Result};
pub use inspect::{Inspection, inspect};
pub use lift::Lift;
pub use lifted::LiftResult;
pub use phantoms::scene_specimen;
pub use rendering::{Rendered, Rendering, ScriptedLift, Seen};
pub use segment::{Segment, Segmented, Wanted, wanted_weights};
pub use solvers::{SOLVERS, solver_named};
pub use trocar_task::{Header as EpisodeHeader, SweepRow};
pub use truth::TruthFigures;
pub use workflow::{
    CompositeFigures, OrganRow, REPORT, Reconstructed, reconstruct_recording, reconstruct_surface, refuse_overlap,
};

/// Hash of the sources that decide what an episode is, and which these are.
pub const EPISODE_MAKERS: &str = env!("TROCAR_EPISODE_MAKERS");
/// See there.
pub const EPISODE_SOURCES: &str = env!("TROCAR_EPISODE_SOURCES");
