//! How a frame is integrated: the solver, and its substeps and iterations.

use crate::{Error, Isa, Result};

/// Where the sweeps of a substep start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The inertial predictor y = x + dt v + dt2 M^-1 f (the paper's).
    Inertial,
    /// The adaptive start of Vertex Block Descent: the predictor with only the share of the
    /// external acceleration that the last substep showed. A body that nothing holds or touches
    /// starts from the inertial predictor, which is its exact motion.
    Adaptive,
}

/// Vertex Block Descent (Chen et al. 2024): a local smoother, a fixed number of sweeps per substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// Substeps a frame.
    pub substeps: usize,
    /// Sweeps over all colours a substep.
    pub iterations: usize,
    /// Start of each substep.
    pub start: Start,
}

/// The warped, prefactored quasi-Newton method: global, and exact to a tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuasiNewton {
    /// Substeps a frame.
    pub substeps: usize,
    /// Greatest number of iterations a substep.
    pub iterations: usize,
    /// Pairs that L-BFGS keeps.
    pub memory: usize,
    /// A correction this small ends a substep (m). A body that goes no farther freely, and whose
    /// correction is no larger, is at rest.
    pub tolerance: f64,
    /// A correction this small over the way that the substep's corrections went so far ends it,
    /// too.
    pub relative: f64,
}

/// A solver with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SolverSettings {
    /// The quasi-Newton method.
    QuasiNewton(QuasiNewton),
    /// Vertex Block Descent.
    Descent(Descent),
}

/// Greatest number of substeps or iterations.
const MAX_COUNT: usize = 1_000_000;

/// Greatest number of pairs: L-BFGS does not profit from more.
const MAX_PAIRS: usize = 64;

impl SolverSettings {
    /// The paper's solver: Vertex Block Descent, 8 substeps of 10 sweeps from the inertial
    /// predictor, with our inversion guard.
    pub const PAPER: Self = Self::Descent(Descent { substeps: 8, iterations: 10, start: Start::Inertial });

    /// The default: two substeps of at most forty quasi-Newton iterations.
    pub const FAST: Self =
        Self::QuasiNewton(QuasiNewton { substeps: 2, iterations: 40, memory: 8, tolerance: 3e-8, relative: 1e-2 });

    /// Substeps a frame.
    pub fn substeps(&self) -> usize {
        match self {
            Self::QuasiNewton(method) => method.substeps,
            Self::Descent(descent) => descent.substeps,
        }
    }

    /// Name of the instruction set of the kernels on this machine.
    pub fn isa(&self) -> &'static str {
        Isa::detect().name()
    }

    /// Refuses settings out of range.
    pub(crate) fn check(&self) -> Result<()> {
        let (substeps, iterations) = match *self {
            Self::QuasiNewton(QuasiNewton { substeps, iterations, memory, tolerance, relative }) => {
                let sane = (0.0..1.0).contains(&tolerance) && (0.0..1.0).contains(&relative);
                if !sane || memory > MAX_PAIRS {
                    return Err(Error::Model(format!(
                        "quasi-Newton settings with tolerance {tolerance} m, relative {relative} and memory {memory}; the tolerances must be in [0, 1), the memory in [0, {MAX_PAIRS}]"
                    )));
                }
                (substeps, iterations)
            }
            Self::Descent(Descent { substeps, iterations, .. }) => (substeps, iterations),
        };
        for (name, count) in [("substeps", substeps), ("iterations", iterations)] {
            if !(1..=MAX_COUNT).contains(&count) {
                return Err(Error::Model(format!("{count} {name}; must be in [1, {MAX_COUNT}]")));
            }
        }
        Ok(())
    }
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self::FAST
    }
}
