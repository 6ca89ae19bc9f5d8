//! Solver settings by the names that the command line, reports and JSON use.

use super::error::{Error, Result};
use trocar_tissue::{Descent, SolverSettings, Start};

/// Names of the settings that benchmarks compare.
pub const SOLVERS: [&str; 2] = ["paper", "fast"];

/// Name of the paper's sweeps with an adaptive start.
const ADAPTIVE: &str = "adaptive";

/// The solver settings of this name, one of [`SOLVERS`] or `adaptive`.
///
/// # Errors
/// An unknown name.
pub fn solver_named(name: &str) -> Result<SolverSettings> {
    match name {
        "paper" => Ok(SolverSettings::PAPER),
        "fast" => Ok(SolverSettings::FAST),
        ADAPTIVE => Ok(SolverSettings::Descent(Descent { substeps: 8, iterations: 10, start: Start::Adaptive })),
        _ => Err(Error::Mismatch(format!(
            "there is no schedule '{name}'; it must be one of {}, {ADAPTIVE}",
            SOLVERS.join(", ")
        ))),
    }
}
