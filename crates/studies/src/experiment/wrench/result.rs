//! The figures of the wrench study.

use serde::Serialize;
use trocar_robot::wrench::{ForceKind, SensorNoise};

/// 95% of chi-squared with ten degrees of freedom are below.
pub(super) const CHI_SQUARED_95: f64 = 18.307;

/// One parameter of the load.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchParameter {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is.
    pub truth: f64,
    /// Mean of the estimates less the truth.
    pub bias: f64,
    /// Standard deviation of the estimates.
    pub spread: f64,
    /// The predicted one.
    pub predicted: f64,
    /// Share of the estimates within 1.96 predicted deviations of the truth; 0.95 is right.
    pub within: f64,
}

/// What poses of one largest tilt tell.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchTilt {
    /// Largest tilt (degrees).
    pub tilt_deg: f64,
    /// Condition number.
    pub condition: f64,
    /// Predicted standard deviation of the weight (mN).
    pub weight_deviation_mn: f64,
}

/// One frame of the ramp. Forces along the contact force.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchFrame {
    /// Time (s).
    pub time_s: f64,
    /// The contact force there is (mN).
    pub truth_mn: f64,
    /// What the sensor reads, weight and bias included (N).
    pub raw_n: f64,
    /// With the identified load taken off, not tared (mN).
    pub untared_mn: f64,
    /// Tared (mN).
    pub tared_mn: f64,
    /// Its predicted standard deviation (mN).
    pub deviation_mn: f64,
    /// What kind of force it is.
    pub kind: ForceKind,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchResult {
    /// Static poses of an identification.
    pub poses: usize,
    /// Largest tilt in them (degrees).
    pub tilt_deg: f64,
    /// Identifications.
    pub runs: usize,
    /// Noise of one reading (N, N m).
    pub noise: SensorNoise,
    /// Condition number of the equations.
    pub condition: f64,
    /// Weight: mean of the estimates (N).
    pub weight_n: f64,
    /// Standard deviation of the estimates (mN).
    pub weight_spread_mn: f64,
    /// The predicted one (mN).
    pub weight_predicted_mn: f64,
    /// The paper's weight (N).
    pub paper_weight_n: f64,
    /// Mean of the squared distance from the truth in predicted deviations; 10 is right.
    pub mean_distance_squared: f64,
    /// Share of the estimates within the predicted 95% ellipsoid.
    pub within_95: f64,
    /// Largest difference between the distances' distribution and chi-squared's (Kolmogorov and
    /// Smirnov) ...
    pub largest_difference: f64,
    /// ... and what it exceeds once in twenty where all is right.
    pub difference_limit: f64,
    /// Mean of the residuals' chi-squared over its degrees of freedom; 1 is right.
    pub residual: f64,
    /// Every parameter.
    pub parameters: Vec<WrenchParameter>,
    /// Squared distances, in order.
    pub distances: Vec<f64>,
    /// What poses of other tilts would tell.
    pub tilts: Vec<WrenchTilt>,
    /// The ramp, frame by frame.
    pub ramp: Vec<WrenchFrame>,
    /// RMS error of the tared force (mN).
    pub tared_error_mn: f64,
    /// RMS error of the untared force (mN).
    pub untared_error_mn: f64,
    /// The contact force from which the tared reading stays above three deviations (mN).
    pub seen_from_mn: Option<f64>,
    /// Wall time (s).
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// Share of chi-squared with ten degrees of freedom below `x`.
pub(super) fn chi_squared_10(x: f64) -> f64 {
    let half = 0.5 * x;
    let terms = (1..5).scan(1.0, |term, k| {
        *term *= half / f64::from(k);
        Some(*term)
    });
    1.0 - (-half).exp() * (1.0 + terms.sum::<f64>())
}
