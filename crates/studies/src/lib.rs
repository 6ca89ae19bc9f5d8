//! The paper's tables and figures, and benchmarks: one file each, behind one trait.
//!
//! A [`study::Study`] has options, runs, and gives its figures and a document of them. [`registry::STUDIES`]
//! lists all. Command line, JSON, page, progress and the tables for the docs come from there.

mod bench;
pub mod docs;
mod error;
mod experiment;
pub mod names;
mod pages;
pub mod registry;
mod schedules;
pub mod study;

pub use bench::{EpisodeBench, MeshingBench, OrgansBench, RenderBench, ScalingBench};
pub use error::{Error, Result};
pub use experiment::{
    ControllerGridExperiment, ConvergenceExperiment, IntegratorsExperiment, PortBudget, RandomActionsExperiment,
    ReconstructionExperiment, RolloutsExperiment, Settling, SimilarityExperiment, Weighing,
};
