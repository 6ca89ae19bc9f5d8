//! Solvers by the names under which the command line, reports and JSON know them.

use super::error::{Error, Result};
use trocar_tissue::{Descent, SolverSettings, Start};

/// The names of the schedules that are measured beside each other.
pub const SOLVERS: [&str; 2] = ["paper", "fast"];

/// Another one that has a name: the paper's sweeps from the adaptive start.
const ADAPTIVE: &str = "adaptive";

/// The schedule of this name, one of [`SOLVERS`] or `adaptive`.
///
/// # Errors
/// Another name.
pub fn solver_named(name: &str) -> Result<SolverSettings> {
    match name {
        "paper" => Ok(SolverSettings::PAPER),
        "fast" => Ok(SolverSettings::FAST),
        ADAPTIVE => Ok(SolverSettings::Descent(Descent { substeps: 8, iterations: 10, start: Start::Adaptive })),
        _ => {
            Err(Error::Mismatch(format!("there is no schedule '{name}'; there are {}, {ADAPTIVE}", SOLVERS.join(", "))))
        }
    }
}
