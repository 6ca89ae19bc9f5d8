//! How likely measured lifts are, given predicted ones.
//!
//! A landmark is off by the tracker's noise, which is its own, and by the error of the model: its
//! mesh, its law and its alignment. That error grows with the lift, is alike in neighbouring
//! landmarks, and most of it is the same in all lifts. Its size is inferred with the parameters.
//! What a Gaussian process does not know is alike in the same way, and the same in all lifts.

use crate::dense::Factor;
use crate::emulator::Prediction;
use crate::observation::{Observation, PER_NEWTON};
use glam::DVec3;

/// Noise of a tracked landmark along an axis (m): trackers of phantoms are 0.4 mm off in the
/// median.
pub(crate) const TRACKER: f64 = 0.25e-3;

/// Length along the organ over which errors of the model are alike (m).
const ALIKE: f64 = 20e-3;

/// Share of the variance of the model's error that all lifts have in common.
const COMMON: f64 = 0.8;

/// Median of the error of the model over the lift before anything is seen, and the deviation of its
/// logarithm.
const ERROR: f64 = 0.05;
const ERROR_SPREAD: f64 = 0.6;

/// Error of a measured force over the force, and beside it (N).
const FORCE_SHARE: f64 = 0.1;
const FORCE_NOISE: f64 = 0.01;

/// The measured lifts.
pub(crate) struct Likelihood {
    /// By axis, all landmarks of all lifts (m).
    measured: [Vec<f64>; 3],
    /// Of each landmark: its lift, its place along the organ (m), and how far the lift goes (m).
    places: Vec<(usize, f64, f64)>,
    /// Place of each landmark, and of each force, among the predicted numbers.
    at: Vec<usize>,
    forces: Vec<(usize, DVec3)>,
}

impl Likelihood {
    pub fn of(lifts: &[Observation]) -> Self {
        let mut made = Self { measured: Default::default(), places: vec![], at: vec![], forces: vec![] };
        let mut next = 0;
        for (l, lift) in lifts.iter().enumerate() {
            for landmark in &lift.landmarks {
                (0..3).for_each(|axis| made.measured[axis].push(landmark.moved[axis]));
                made.places.push((l, landmark.along, lift.pull.displacement.length()));
                made.at.push(next);
                next += 3;
            }
            if let Some(force) = lift.force {
                made.forces.push((next, force));
                next += 3;
            }
        }
        made
    }

    /// The error of the model over the lift, of a standard normal score.
    pub fn model_error(score: f64) -> f64 {
        ERROR * (ERROR_SPREAD * score).exp()
    }

    /// Logarithm of the likelihood, without a constant, if the model's error has this score.
    pub fn log(&self, predicted: &Prediction, error_score: f64) -> f64 {
        let error = Self::model_error(error_score);
        let covariance = |i: usize, j: usize| {
            let ((a, x, way_a), (b, y, way_b)) = (self.places[i], self.places[j]);
            let shared = if a == b { 1.0 } else { COMMON };
            let alike = (-(x - y).abs() / ALIKE).exp();
            let own = if i == j { TRACKER * TRACKER } else { 0.0 };
            own + (error * error * way_a * way_b * shared + predicted.variance) * alike
        };
        let Some(factor) = Factor::of(self.places.len(), covariance) else { return f64::NEG_INFINITY };
        let mut log = -1.5 * factor.log_determinant();
        for axis in 0..3 {
            let off = self.measured[axis].iter().zip(&self.at).map(|(m, at)| m - predicted.mean[at + axis]);
            log -= 0.5 * factor.distance(&mut off.collect::<Vec<_>>());
        }
        for (at, force) in &self.forces {
            let spread = predicted.variance / (PER_NEWTON * PER_NEWTON);
            let noise = (FORCE_SHARE + error) * force.length();
            let variance = noise * noise + FORCE_NOISE * FORCE_NOISE + spread;
            for axis in 0..3 {
                let off = force[axis] - predicted.mean[at + axis] / PER_NEWTON;
                log -= 0.5 * (off * off / variance + variance.ln());
            }
        }
        log
    }
}
