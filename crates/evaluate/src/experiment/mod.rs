//! The paper's tables and figures, made anew: one file an experiment.

mod reconstruction;

pub use reconstruction::{PhantomFigures, ReconstructionExperiment, ReconstructionResult, ReconstructionRow};
