//! What studies do with schedules: one substep of them, and how many iterations they have.

use trocar_tissue::{Descent, Newton, QuasiNewton, Schedule, SemiImplicit, Xpbd};

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
