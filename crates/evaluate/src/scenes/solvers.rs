//! Solvers by the names under which the command line, reports and JSON know them.

use crate::{Error, Result};
use trocar_tissue::{Descent, Newton, Schedule, SemiImplicit, Xpbd};

/// The names, and the schedules behind them.
pub const SOLVERS: [&str; 2] = ["paper", "fast"];

/// The schedule of this name.
///
/// # Errors
/// Another name.
pub fn solver_named(name: &str) -> Result<Schedule> {
    match name {
        "paper" => Ok(Schedule::PAPER),
        "fast" => Ok(Schedule::default()),
        _ => Err(Error::Mismatch(format!("there is no schedule '{name}'; there are {}", SOLVERS.join(", ")))),
    }
}

/// One substep of `schedule`, with this many iterations.
pub fn one_substep(schedule: Schedule, iterations: usize) -> Schedule {
    match schedule {
        Schedule::Descent(descent) => Schedule::Descent(Descent { substeps: 1, iterations, ..descent }),
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
        Schedule::Xpbd(settings) => settings.iterations,
        Schedule::SemiImplicit(_) | Schedule::Newton(_) => 1,
    }
}
