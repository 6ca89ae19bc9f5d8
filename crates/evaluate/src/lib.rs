//! The commands' work from folder to folder, and the reports: what came out, beside what the paper says.

mod bench;
mod cell_run;
mod demo;
mod error;
mod experiment;
mod inspect;
mod paper;
pub mod report;
pub mod scenes;
mod segment;
mod truth;
mod workflow;

pub use bench::{
    CellBench, CellBenchResult, GraspBench, GraspBenchResult, GraspPhaseTiming, Machine, ManyRow, MeshingBench,
    MeshingResult, MeshingRow, OrganSource, OrgansBench, OrgansResult, RayRow, RenderBench, RenderBenchResult,
    ScalingBench, ScalingResult, ScalingRow, Timing,
};
pub use cell_run::{CellRun, CellSimulation, TimedEvent, scene_specimen};
pub use demo::{Demo, DemoResult};
pub use error::{Error, Result};
pub use experiment::{
    AppendixSource, ControllerBars, ControllerFigures, ControllerGridExperiment, ControllerGridResult,
    ControllerInstant, ControllerRow, ConvergenceCase, ConvergenceExperiment, ConvergenceResult,
    ElementQualityExperiment, ElementQualityResult, ElementQualityRow, GraspDesignRow, GraspDesignsExperiment,
    GraspDesignsResult, GraspTrial, IntegratorRow, IntegratorsExperiment, IntegratorsResult, PaperGrasp,
    PaperSimilarity, PhantomFigures, PortBudgetExperiment, PortBudgetResult, PortBudgetRow, PortRoom, PortStart,
    ReconstructionExperiment, ReconstructionResult, ReconstructionRow, Resumed, SettlingExperiment, SettlingOrgan,
    SettlingResult, SettlingRow, SimilarityExperiment, SimilarityResult, SimilarityRow, StepRow, WrenchExperiment,
    WrenchFrame, WrenchParameter, WrenchResult, WrenchTilt,
};
pub use inspect::{Inspection, inspect};
pub use segment::{Segment, Segmented, Wanted, wanted_weights};
pub use truth::TruthFigures;
pub use workflow::{
    CompositeFigures, OrganRow, Reconstructed, SimulatedRun, reconstruct_recording, reconstruct_surface, simulate,
};
