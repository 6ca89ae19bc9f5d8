//! Solvers by the names under which the command line, reports and JSON know them.

use crate::{Error, Result};
use trocar_tissue::{Descent, Newton, QuasiNewton, Schedule, SemiImplicit, Start, Xpbd};

/// The names of the schedules that are measured beside each other.
pub const SOLVERS: [&str; 2] = ["paper", "fast"];

/// Another one that has a name: the paper's sweeps from the adaptive start.
const ADAPTIVE: &str = "adaptive";

/// The schedule of this name, one of [`SOLVERS`] or `adaptive`.
///
/// # Errors
/// Another name.
pub fn solver_named(name: &str) -> Result<Schedule> {
    match name {
        "paper" => Ok(Schedule::PAPER),
        "fast" => Ok(Schedule::FAST),
        ADAPTIVE => Ok(Schedule::Descent(Descent { substeps: 8, iterations: 10, start: Start::Adaptive })),
        _ => {
            Err(Error::Mismatch(format!("there is no schedule '{name}'; there are {}, {ADAPTIVE}", SOLVERS.join(", "))))
        }
    }
}

/// One substep of `schedule`, with this many iterations and no early exit.
pub fn one_substep(schedule: Schedule, iterations: usize) -> Schedule {
    match schedule {
        Schedule::Descent(descent) => Schedule::Descent(Descent { substeps: 1, iterations, ..descent }),
        Schedule::QuasiNewton(method) => {
            Schedule::QuasiNewton(QuasiNewton { substeps: 1, iterations, tolerance: 0.0, ..method })
        }
        Schedule::Xpbd(settings) => Schedule::Xpbd(Xpbd { substeps: 1, iterations, ..settings }),
        // They have no iterations.
        Schedule::SemiImplicit(_) => Schedule::SemiImplicit(SemiImplicit { substeps: 1 }),
        Schedule::Newton(_) => Schedule::Newton(Newton { substeps: 1 }),
    }
}

/// Iterations of each substep of `schedule`.
pub fn iterations_of(schedule: Schedule) -> usize {
    match schedule {
        Schedule::Descent(descent) => descent.iterations,
        Schedule::QuasiNewton(method) => method.iterations,
        Schedule::Xpbd(settings) => settings.iterations,
        Schedule::SemiImplicit(_) | Schedule::Newton(_) => 1,
    }
}
