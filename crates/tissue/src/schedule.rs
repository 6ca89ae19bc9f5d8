//! How a frame is cut into substeps and sweeps.

/// Where the sweeps of a substep start from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The inertial predictor y = x + dt v + dt2 M^-1 f (the paper's).
    Inertial,
    /// VBD's adaptive start: the predictor with only that share of the external acceleration that the last substep showed.
    /// A body that nothing holds or touches starts from the inertial predictor, which is its exact motion.
    Adaptive,
}

/// A frame's substeps and sweeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Substeps a frame.
    pub substeps: usize,
    /// Sweeps over all colours a substep.
    pub iterations: usize,
    /// Start of each substep.
    pub start: Start,
}

impl Schedule {
    /// The paper's substeps, sweeps and start (8 of 10 from the inertial predictor), with our inversion guard.
    pub const PAPER: Self = Self { substeps: 8, iterations: 10, start: Start::Inertial };
}

impl Default for Schedule {
    fn default() -> Self {
        Self { start: Start::Adaptive, ..Self::PAPER }
    }
}
