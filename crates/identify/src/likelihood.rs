//! How likely measured lifts are, given predicted ones.
//!
//! A landmark is off by the tracker's noise, which is its own, and by the error of the model: its
//! mesh, its law and its alignment. That error grows with the lift, is alike in neighbouring
//! landmarks, and most of it is the same in all lifts. Its size is inferred with the parameters.
//! What a Gaussian process does not know is alike in the same way, and the same in all lifts. An
//! error of a measured pull moves its lift as the simulation says (`pull_error.rs`).

use crate::dense::{Factor, dot};
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
    /// Of each error of a pull: the first landmark that it moves, and by axis how far it moves it
    /// and all further ones of its lift (m).
    pulls: Vec<(usize, [Vec<f64>; 3])>,
}

impl Likelihood {
    pub fn of(lifts: &[Observation]) -> Self {
        let mut made = Self { measured: Default::default(), places: vec![], at: vec![], forces: vec![], pulls: vec![] };
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

    /// Takes account of errors of the pulls: how the numbers of all lifts change with a deviation
    /// of each.
    pub fn with_pull_errors(&mut self, rows: &[Vec<f64>]) {
        let own = |row: &Vec<f64>| {
            let moves = |i: &usize| (0..3).any(|axis| row[self.at[*i] + axis] != 0.0);
            let first = (0..self.at.len()).find(moves)?;
            Some((first, [0, 1, 2].map(|axis| self.at[first..].iter().map(|at| row[at + axis]).collect())))
        };
        self.pulls = rows.iter().filter_map(own).collect();
    }

    /// The error of the model over the lift, of a standard normal score.
    pub fn model_error(score: f64) -> f64 {
        ERROR * (ERROR_SPREAD * score).exp()
    }

    /// Logarithm of the likelihood, without a constant, if the model's error has this score.
    pub fn log(&self, predicted: &Prediction, error_score: f64) -> f64 {
        let [distance, determinant] = self.parts(predicted, predicted.variance, error_score);
        -0.5 * (distance + determinant)
    }

    /// The same, but an uncertain prediction costs nothing: values stay in question until their
    /// simulation is known well enough to rule them out.
    pub fn in_question(&self, predicted: &Prediction, error_score: f64) -> f64 {
        let [distance, _] = self.parts(predicted, predicted.variance, error_score);
        let [_, determinant] = self.parts(predicted, 0.0, error_score);
        -0.5 * (distance + determinant)
    }

    /// The squared distance of the measured from predicted lifts in deviations, and the logarithm
    /// of the determinant of their covariance, if the prediction has this variance.
    fn parts(&self, predicted: &Prediction, variance: f64, error_score: f64) -> [f64; 2] {
        let error = Self::model_error(error_score);
        let covariance = |i: usize, j: usize| {
            let ((a, x, way_a), (b, y, way_b)) = (self.places[i], self.places[j]);
            let shared = if a == b { 1.0 } else { COMMON };
            let alike = (-(x - y).abs() / ALIKE).exp();
            let own = if i == j { TRACKER * TRACKER } else { 0.0 };
            own + (error * error * way_a * way_b * shared + variance) * alike
        };
        let Some(factor) = Factor::of(self.places.len(), covariance) else { return [f64::INFINITY; 2] };
        let (mut total, mut determinant) = (0.0, 3.0 * factor.log_determinant());
        // The errors of the pulls have few directions U: by Woodbury's formula the inverse of
        // K + U U' needs the factor of 1 + U' K^-1 U alone.
        let (landmarks, pulls) = (self.places.len(), self.pulls.len());
        let (mut square, mut along) = (vec![0.0; pulls * pulls], vec![0.0; pulls]);
        for axis in 0..3 {
            let off = self.measured[axis].iter().zip(&self.at).map(|(m, at)| m - predicted.mean[at + axis]);
            let mut off: Vec<f64> = off.collect();
            total += factor.distance(&mut off);
            let scaled = |(first, moved): &(usize, [Vec<f64>; 3])| {
                let mut scaled = vec![0.0; landmarks];
                scaled[*first..].copy_from_slice(&moved[axis]);
                factor.forward(&mut scaled);
                scaled
            };
            let scaled: Vec<Vec<f64>> = self.pulls.iter().map(scaled).collect();
            for (i, one) in scaled.iter().enumerate() {
                along[i] += dot(one, &off);
                (0..=i).for_each(|j| square[i * pulls + j] += dot(one, &scaled[j]));
            }
        }
        let own = |i: usize, j: usize| square[i * pulls + j] + if i == j { 1.0 } else { 0.0 };
        let Some(factor) = Factor::of(pulls, own) else { return [f64::INFINITY; 2] };
        total -= factor.distance(&mut along);
        determinant += factor.log_determinant();
        for (at, force) in &self.forces {
            let spread = variance / (PER_NEWTON * PER_NEWTON);
            let noise = (FORCE_SHARE + error) * force.length();
            let variance = noise * noise + FORCE_NOISE * FORCE_NOISE + spread;
            for axis in 0..3 {
                let off = force[axis] - predicted.mean[at + axis] / PER_NEWTON;
                total += off * off / variance;
                determinant += variance.ln();
            }
        }
        [total, determinant]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lone_organ::{Grip, Pull};
    use crate::observation::Landmark;

    #[test]
    fn errors_of_pulls_are_part_of_the_covariance() {
        let lift = |number: usize, seed: f64| Observation {
            number,
            pull: Pull { s: 0.5, displacement: 0.01 * DVec3::Z, grip: Grip::Place },
            landmarks: (0..3)
                .map(|k| {
                    let along = 0.01 * f64::from(k);
                    let moved = 1e-3 * DVec3::new((seed + along).sin(), (7.0 * seed).cos(), 3.0 * along + seed);
                    Landmark { along, rest: DVec3::ZERO, moved }
                })
                .collect(),
            force: None,
        };
        let lifts = [lift(0, 0.3), lift(1, 0.9)];
        let mut likelihood = Likelihood::of(&lifts);
        let predicted = Prediction { mean: (0..18).map(|i| 2e-4 * f64::from(i)).collect(), variance: 1e-8 };
        let without = likelihood.log(&predicted, 0.2);
        let wave = |i: usize, k: usize| 3e-4 * ((1 + k) as f64 * (i as f64 + 0.5)).sin();
        let rows: Vec<Vec<f64>> =
            (0..2).map(|k| (0..18).map(|i| if i / 9 == k { wave(i, k) } else { 0.0 }).collect()).collect();
        likelihood.with_pull_errors(&rows);
        let with = likelihood.log(&predicted, 0.2);
        // The same with the full matrix.
        let error = Likelihood::model_error(0.2);
        let full = |rows: &[Vec<f64>]| {
            let element = |i: usize, j: usize| {
                let ((a, x, way_a), (b, y, way_b)) = (likelihood.places[i / 3], likelihood.places[j / 3]);
                let shared = if a == b { 1.0 } else { COMMON };
                let smooth = (error * error * way_a * way_b * shared + 1e-8) * (-(x - y).abs() / ALIKE).exp();
                let smooth = if i % 3 == j % 3 { smooth } else { 0.0 };
                let own = if i == j { TRACKER * TRACKER } else { 0.0 };
                smooth + own + rows.iter().map(|row| row[i] * row[j]).sum::<f64>()
            };
            let factor = Factor::of(18, element).unwrap();
            let measured = lifts.iter().flat_map(Observation::measured);
            let mut off: Vec<f64> = measured.zip(&predicted.mean).map(|(m, p)| m - p).collect();
            -0.5 * (factor.log_determinant() + factor.distance(&mut off))
        };
        assert!((without - full(&[])).abs() < 1e-8, "{without}, {}", full(&[]));
        assert!((with - full(&rows)).abs() < 1e-8, "{with}, {}", full(&rows));
    }
}
