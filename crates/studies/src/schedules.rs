//! What studies do with schedules: one substep of them, and how many iterations they have.

use trocar_tissue::{Descent, QuasiNewton, SolverSettings};

/// One substep of `schedule`, with this many iterations and no early exit.
pub fn one_substep(schedule: SolverSettings, iterations: usize) -> SolverSettings {
    match schedule {
        SolverSettings::Descent(descent) => SolverSettings::Descent(Descent { substeps: 1, iterations, ..descent }),
        SolverSettings::QuasiNewton(method) => {
            SolverSettings::QuasiNewton(QuasiNewton { substeps: 1, iterations, tolerance: 0.0, ..method })
        }
    }
}

/// Iterations of each substep of `schedule`.
pub fn iterations_of(schedule: SolverSettings) -> usize {
    match schedule {
        SolverSettings::Descent(descent) => descent.iterations,
        SolverSettings::QuasiNewton(method) => method.iterations,
    }
}
