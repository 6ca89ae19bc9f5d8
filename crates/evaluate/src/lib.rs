//! The commands' work from folder to folder, and the reports: what came out, beside what the paper says.

mod bench;
mod campaign;
mod cell_run;
mod demo;
mod episode_run;
mod error;
mod experiment;
mod inspect;
mod moving;
mod paper;
mod rendering;
mod replayed;
pub mod report;
pub mod scenes;
mod segment;
mod truth;
mod watched;
mod workflow;

pub use bench::{
    CameraRow, CellBench, CellBenchResult, CellRow, EpisodeBench, EpisodeBenchResult, GraspBench, GraspBenchResult,
    GraspPhaseTiming, Machine, ManyRow, MeshingBench, MeshingResult, MeshingRow, OrganSource, OrgansBench,
    OrgansResult, RayRow, RenderBench, RenderBenchResult, ScalingBench, ScalingResult, ScalingRow, Timing,
};
pub use campaign::{
    Campaign, CampaignResult, Comparison, Files, Interval, Job, Kept, Plan, PolicyRow, PolicySpec, StageCount, Store,
    Worker,
};
pub use cell_run::{CellRun, CellSimulation, TimedEvent, scene_specimen};
pub use demo::{Demo, DemoResult};
pub use episode_run::{EpisodeMade, EpisodeRun, read_episode, replay, sweep_files};
pub use error::{Error, Result};
pub use experiment::{
    AppendixSource, ControllerBars, ControllerFigures, ControllerGridExperiment, ControllerGridResult,
    ControllerInstant, ControllerRow, ConvergenceCase, ConvergenceExperiment, ConvergenceResult,
    ElementQualityExperiment, ElementQualityResult, ElementQualityRow, GraspDesignRow, GraspDesignsExperiment,
    GraspDesignsResult, GraspTrial, IntegratorRow, IntegratorsExperiment, IntegratorsResult, PaperGrasp, PaperRollouts,
    PaperSimilarity, PhantomFigures, PortBudgetExperiment, PortBudgetResult, PortBudgetRow, PortRoom, PortStart,
    RandomActionsExperiment, RandomActionsResult, RandomActionsRow, ReconstructionExperiment, ReconstructionResult,
    ReconstructionRow, Resumed, RolloutsExperiment, RolloutsResult, SettlingExperiment, SettlingOrgan, SettlingResult,
    SettlingRow, SimilarityExperiment, SimilarityResult, SimilarityRow, StepRow, WrenchExperiment, WrenchFrame,
    WrenchParameter, WrenchResult, WrenchTilt,
};
pub use inspect::{Inspection, inspect};
pub use rendering::{Rendered, Rendering, Seen};
pub use segment::{Segment, Segmented, Wanted, wanted_weights};
pub use trocar_task::{Header as EpisodeHeader, SweepRow};
pub use truth::TruthFigures;
pub use workflow::{
    CompositeFigures, OrganRow, Reconstructed, SimulatedRun, reconstruct_recording, reconstruct_surface, simulate,
};
