//! The figures of the wrench study.

use serde::Serialize;
use trocar_robot::wrench::{ForceKind, SensorNoise};

/// The 95% quantile of chi-squared with ten degrees of freedom.
pub(super) const CHI_SQUARED_95: f64 = 18.307;

/// One parameter of the load.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchParameter {
    /// Name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// True value.
    pub truth: f64,
    /// Mean of the estimates minus the true value.
    pub bias: f64,
    /// Standard deviation of the estimates.
    pub spread: f64,
    /// Predicted standard deviation.
    pub predicted: f64,
    /// Share of the estimates within 1.96 predicted standard deviations of the true value; 0.95 is
    /// correct.
    pub within: f64,
}

/// An identification with another largest tilt.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchTilt {
    /// Largest tilt (degrees).
    pub tilt_deg: f64,
    /// Condition number.
    pub condition: f64,
    /// Predicted standard deviation of the weight (mN).
    pub weight_deviation_mn: f64,
}

/// One frame of the ramp. Forces are along the contact force.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchFrame {
    /// Time (s).
    pub time_s: f64,
    /// True contact force (mN).
    pub truth_mn: f64,
    /// Sensor reading, with weight and bias (N).
    pub raw_n: f64,
    /// Reading minus the identified load, not tared (mN).
    pub untared_mn: f64,
    /// The same, tared (mN).
    pub tared_mn: f64,
    /// Predicted standard deviation of the tared force (mN).
    pub deviation_mn: f64,
    /// Kind of the force.
    pub kind: ForceKind,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchResult {
    /// Static poses per identification.
    pub poses: usize,
    /// Largest tilt of these poses (degrees).
    pub tilt_deg: f64,
    /// Number of identifications.
    pub runs: usize,
    /// Noise of one reading (N, N m).
    pub noise: SensorNoise,
    /// Condition number of the equations.
    pub condition: f64,
    /// Mean of the estimates of the weight (N).
    pub weight_n: f64,
    /// Standard deviation of these estimates (mN).
    pub weight_spread_mn: f64,
    /// Predicted standard deviation (mN).
    pub weight_predicted_mn: f64,
    /// The paper's weight (N).
    pub paper_weight_n: f64,
    /// Mean squared distance from the truth in predicted standard deviations; 10 is correct.
    pub mean_distance_squared: f64,
    /// Share of the estimates within the predicted 95% ellipsoid.
    pub within_95: f64,
    /// Largest difference between the distribution of the distances and chi-squared
    /// (Kolmogorov-Smirnov).
    pub largest_difference: f64,
    /// Value that this difference exceeds in 5% of correct experiments.
    pub difference_limit: f64,
    /// Mean chi-squared of the residuals over its degrees of freedom; 1 is correct.
    pub residual: f64,
    /// All parameters.
    pub parameters: Vec<WrenchParameter>,
    /// Squared distances, sorted.
    pub distances: Vec<f64>,
    /// Identifications with other largest tilts.
    pub tilts: Vec<WrenchTilt>,
    /// Frames of the ramp.
    pub ramp: Vec<WrenchFrame>,
    /// RMS error of the tared force (mN).
    pub tared_error_mn: f64,
    /// RMS error of the untared force (mN).
    pub untared_error_mn: f64,
    /// Contact force from which the tared reading stays above three standard deviations (mN).
    pub seen_from_mn: Option<f64>,
}

/// Cumulative distribution of chi-squared with ten degrees of freedom.
pub(super) fn chi_squared_10(x: f64) -> f64 {
    let half = 0.5 * x;
    let terms = (1..5).scan(1.0, |term, k| {
        *term *= half / f64::from(k);
        Some(*term)
    });
    1.0 - (-half).exp() * (1.0 + terms.sum::<f64>())
}
