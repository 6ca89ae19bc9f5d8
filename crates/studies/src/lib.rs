//! The paper's tables and figures, and the benchmarks: one file or folder each, behind one trait.
//!
//! A [`study::Study`] has options; its run gives figures and a document. [`registry::STUDIES`]
//! lists all studies. Command line, JSON, page, progress and the tables for the docs come from the
//! trait.

mod bench;
pub mod docs;
mod experiment;
mod machine;
pub mod names;
pub mod registry;
pub mod scenes;
mod side_by_side;
mod statistics;
pub mod study;
mod trials;

pub use bench::{CellBench, EpisodeBench, GraspBench, MeshingBench, OrgansBench, RenderBench, ScalingBench};
pub use experiment::{
    ContactExperiment, ControllerGridExperiment, ConvergenceExperiment, ElementQualityExperiment,
    GraspDesignsExperiment, IntegratorsExperiment, PortBudgetExperiment, RandomActionsExperiment,
    ReconstructionExperiment, RolloutsExperiment, SettlingExperiment, SimilarityExperiment, WrenchExperiment,
};
pub use trocar_workflow::{Error, Result};
