//! The work of the commands: read a folder, run, write the result and its page.

mod counted;
mod demo;
pub mod episode_replay;
mod episode_run;
mod error;
mod gltf;
pub mod identify;
mod inspect;
mod lift;
pub mod lift_film;
mod lift_result;
pub mod measure;
pub mod pages;
pub mod paper;
pub mod phantoms;
mod reconstruct;
mod recorder;
mod rendering;
mod segment;
mod solvers;
mod specimen_cache;
pub mod specimen_scene;
pub mod surfaces;
pub mod video;

pub use counted::counted;
pub use demo::{Demo, DemoResult};
pub use episode_run::{EpisodeOutput, EpisodeRun, read_episode, read_varied, replay, sweep_files};
pub use error::{Error, Result, check_interrupted};
pub use gltf::{GltfSummary, MAX_KEYFRAMES, write_gltf};
pub use inspect::{Inspection, inspect};
pub use lift::Lift;
pub use lift_result::LiftResult;
pub use phantoms::scene_specimen;
pub use reconstruct::{
    CompositeFigures, OrganRow, REPORT, Reconstructed, ReconstructedRecording, reconstruct_recording,
    reconstruct_surface, refuse_scene_overlap,
};
pub use rendering::{Rendered, Rendering, ScriptedLift, VisibleObject};
pub use segment::{Segment, Segmented, WeightFile, weight_files};
pub use solvers::{SOLVERS, solver_named};
pub use specimen_cache::{SpecimenCache, drawn_specimens};
pub use surfaces::{RecordedEpisode, SURFACES_FILE, SurfaceRecorder, SurfaceWatch};
pub use trocar_task::{Header as EpisodeHeader, SweepRow};

/// Hash of the sources that an episode depends on.
pub const EPISODE_SOURCE_HASH: &str = env!("TROCAR_EPISODE_SOURCE_HASH");
/// The hashed sources, separated by spaces.
pub const EPISODE_SOURCES: &str = env!("TROCAR_EPISODE_SOURCES");
