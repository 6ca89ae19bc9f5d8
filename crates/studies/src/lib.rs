//! The paper's tables and figures, and benchmarks.

mod bench;
mod error;
mod experiment;
mod pages;
mod schedules;

pub use bench::{
    CameraRow, CellBench, CellBenchResult, CellRow, EpisodeBench, EpisodeBenchResult, GraspBench, GraspBenchResult,
    GraspPhaseTiming, Machine, ManyRow, MeshingBench, MeshingResult, MeshingRow, OrganSource, OrgansBench,
    OrgansResult, RayRow, RenderBench, RenderBenchResult, ScalingBench, ScalingResult, ScalingRow, Timing,
};
pub use error::{Error, Result};
pub use experiment::{
    AppendixSource, Condition, ControllerBars, ControllerFigures, ControllerGridExperiment, ControllerGridResult,
    ControllerInstant, ControllerRow, ConvergenceCase, ConvergenceExperiment, ConvergenceResult,
    ElementQualityExperiment, ElementQualityResult, ElementQualityRow, GraspDesignRow, GraspDesignsExperiment,
    GraspDesignsResult, GraspTrial, IntegratorRow, IntegratorsExperiment, IntegratorsResult, PaperGrasp, PaperRollouts,
    PaperSimilarity, PhantomFigures, PortBudgetExperiment, PortBudgetResult, PortBudgetRow, PortRoom, PortStart,
    RandomActionsExperiment, RandomActionsResult, RandomActionsRow, ReconstructionExperiment, ReconstructionResult,
    ReconstructionRow, Resumed, RolloutsExperiment, RolloutsResult, SettlingExperiment, SettlingOrgan, SettlingResult,
    SettlingRow, SimilarityExperiment, SimilarityResult, SimilarityRow, StepRow, WrenchExperiment, WrenchFrame,
    WrenchParameter, WrenchResult, WrenchTilt,
};
