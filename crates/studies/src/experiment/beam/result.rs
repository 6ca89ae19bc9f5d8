//! The figures of the study.

use super::swing::Swing;
use serde::Serialize;

/// The beam under one load, as it was seen and as it is predicted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeamCase {
    /// `fitted` or `predicted`.
    pub case: &'static str,
    /// Weight on the end (N).
    pub load_n: f64,
    /// As recorded: the mean of the recordings.
    pub measured: Swing,
    /// As simulated.
    pub simulated: Swing,
}

/// The predicted case by other numbers of substeps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubstepRow {
    /// Length of a substep (ms).
    pub substep_ms: f64,
    /// Whether it is that of the default schedule.
    pub is_default: bool,
    /// As simulated.
    pub simulated: Swing,
}

/// The figures of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BeamResult {
    /// Error of the predicted displacement at rest, over the measured one.
    pub displacement_error: f64,
    /// Error of the predicted period of the first oscillation.
    pub period_error: f64,
    /// Error of the predicted first peak.
    pub first_peak_error: f64,
    /// Error of the predicted damping ratio.
    pub damping_error: f64,
    /// Fitted Young's modulus (Pa).
    pub young_modulus: f64,
    /// Fitted shear viscosity (Pa s).
    pub viscosity: f64,
    /// Nodes of the beam.
    pub nodes: usize,
    /// The case that was fitted, and the one that is predicted.
    pub cases: Vec<BeamCase>,
    /// What the length of a substep does to the predicted case.
    pub substeps: Vec<SubstepRow>,
}

impl BeamCase {
    /// Relative error of one number (at least 0).
    pub(super) fn error(&self, of: fn(&Swing) -> f64) -> f64 {
        (of(&self.simulated) / of(&self.measured) - 1.0).abs()
    }
}
