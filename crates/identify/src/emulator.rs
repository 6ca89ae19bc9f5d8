//! A Gaussian process through simulated lifts: it stands in for the simulation while the posterior
//! is explored (M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", 2001).
//!
//! All numbers of the lifts share one kernel: a constant, a linear part, and Matern's with 5/2 and
//! a length for each parameter, because lifts have kinks where threads become taut. The lengths
//! and the nugget maximise the likelihood.

use crate::dense::{Factor, dot};

/// Variances of the constant and the linear part, over that of Matern's part.
const CONSTANT: f64 = 10.0;
const LINEAR: f64 = 1.0;

/// Logarithms of the lengths (in deviations of the prior) and of the nugget where the search
/// begins, and their ranges.
const START: [f64; 2] = [0.7, -6.0];
const LENGTHS: [f64; 2] = [-1.0, 3.0];
const NUGGETS: [f64; 2] = [-11.0, -1.0];

/// Steps of the search, from coarse to fine.
const STEPS: [f64; 3] = [0.8, 0.4, 0.2];

/// What a Gaussian process foretells.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    /// One a number.
    pub mean: Vec<f64>,
    /// Variance of each number.
    pub variance: f64,
}

/// Gaussian processes of numbers over scores.
pub(crate) struct Emulator {
    points: Vec<Vec<f64>>,
    kernel: Kernel,
    factor: Factor,
    /// K^-1 y, one row a number.
    weights: Vec<Vec<f64>>,
    offset: Vec<f64>,
    /// Variance of Matern's part.
    amplitude: f64,
}

/// The kernel over its amplitude.
#[derive(Clone, Debug)]
struct Kernel {
    /// Inverse lengths.
    inverse: Vec<f64>,
    nugget: f64,
}

impl Kernel {
    fn of(logs: &[f64]) -> Self {
        let (nugget, lengths) = (logs[logs.len() - 1], &logs[..logs.len() - 1]);
        Self { inverse: lengths.iter().map(|l| (-l).exp()).collect(), nugget: nugget.exp() }
    }

    fn at(&self, a: &[f64], b: &[f64]) -> f64 {
        let (mut distance, mut linear) = (0.0, 0.0);
        for k in 0..a.len() {
            let apart = (a[k] - b[k]) * self.inverse[k];
            distance += apart * apart;
            linear += a[k] * b[k];
        }
        let apart = (5.0 * distance).sqrt();
        CONSTANT + LINEAR * linear + (1.0 + apart + apart * apart / 3.0) * (-apart).exp()
    }

    fn factor(&self, points: &[Vec<f64>]) -> Option<Factor> {
        let nugget = |i: usize, j: usize| if i == j { self.nugget } else { 0.0 };
        Factor::of(points.len(), |i, j| self.at(&points[i], &points[j]) + nugget(i, j))
    }
}

impl Emulator {
    /// Through `values` at `points`, one row each. None if there is no kernel with a factor.
    pub fn through(points: &[Vec<f64>], values: &[Vec<f64>]) -> Option<Self> {
        let (dimensions, numbers) = (points.first()?.len(), values.first()?.len());
        let mean = |k: usize| values.iter().map(|row| row[k]).sum::<f64>() / values.len() as f64;
        let offset: Vec<f64> = (0..numbers).map(mean).collect();
        let columns: Vec<Vec<f64>> =
            (0..numbers).map(|k| values.iter().map(|row| row[k] - offset[k]).collect()).collect();
        // The likelihood of neighbouring numbers is alike: every third of each axis is enough.
        let some: Vec<&Vec<f64>> = columns.iter().enumerate().filter(|(k, _)| k / 3 % 3 == 0).map(|c| c.1).collect();
        let misfit = |logs: &[f64]| -> f64 {
            let Some(factor) = Kernel::of(logs).factor(points) else { return f64::INFINITY };
            let total: f64 = some.iter().map(|column| factor.distance(&mut (*column).clone())).sum();
            let (n, m) = (points.len() as f64, some.len() as f64);
            n * m * (total / (n * m)).max(f64::MIN_POSITIVE).ln() + m * factor.log_determinant()
        };
        let mut logs = vec![START[0]; dimensions + 1];
        logs[dimensions] = START[1];
        let mut least = misfit(&logs);
        for step in STEPS {
            for _ in 0..2 {
                for k in 0..=dimensions {
                    let [low, high] = if k < dimensions { LENGTHS } else { NUGGETS };
                    let step = if k < dimensions { step } else { 2.0 * step };
                    for sign in [1.0, -1.0] {
                        let mut tried = logs.clone();
                        tried[k] = (tried[k] + sign * step).clamp(low, high);
                        let other = misfit(&tried);
                        if other < least {
                            (least, logs) = (other, tried);
                            break;
                        }
                    }
                }
            }
        }
        let kernel = Kernel::of(&logs);
        let factor = kernel.factor(points)?;
        let mut total = 0.0;
        let weights: Vec<Vec<f64>> = columns
            .iter()
            .map(|column| {
                let mut weights = column.clone();
                factor.solve(&mut weights);
                total += dot(column, &weights);
                weights
            })
            .collect();
        let amplitude = total / (points.len() * numbers) as f64;
        Some(Self { points: points.to_vec(), kernel, factor, weights, offset, amplitude })
    }

    /// What it foretells at a point.
    pub fn at(&self, point: &[f64]) -> Prediction {
        let mut kernel: Vec<f64> = self.points.iter().map(|p| self.kernel.at(p, point)).collect();
        let mean = self.weights.iter().zip(&self.offset).map(|(w, offset)| offset + dot(w, &kernel)).collect();
        let own = self.kernel.at(point, point) + self.kernel.nugget;
        let variance = self.amplitude * (own - self.factor.distance(&mut kernel)).max(0.0);
        Prediction { mean, variance }
    }

    /// Those `count` of some candidates that tell most about all: each has the largest variance
    /// that simulations of those before it would leave.
    pub fn most_uncertain(&self, candidates: &[Vec<f64>], count: usize) -> Vec<usize> {
        let row = |c: &Vec<f64>| {
            let mut row: Vec<f64> = self.points.iter().map(|p| self.kernel.at(p, c)).collect();
            self.factor.forward(&mut row);
            row
        };
        let mut rows: Vec<Vec<f64>> = candidates.iter().map(row).collect();
        let mut left: Vec<f64> = candidates.iter().zip(&rows).map(|(c, r)| self.kernel.at(c, c) - dot(r, r)).collect();
        let mut chosen = Vec::new();
        while chosen.len() < count.min(candidates.len()) {
            let free = (0..left.len()).filter(|i| !chosen.contains(i));
            let Some(next) = free.max_by(|a, b| left[*a].total_cmp(&left[*b])) else { break };
            let (own, pivot) = (rows[next].clone(), (left[next].max(0.0) + self.kernel.nugget).sqrt());
            for (j, row) in rows.iter_mut().enumerate() {
                let told = (self.kernel.at(&candidates[next], &candidates[j]) - dot(&own, row)) / pivot;
                row.push(told);
                left[j] -= told * told;
            }
            chosen.push(next);
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::Random;

    #[test]
    fn a_smooth_function_is_predicted_within_its_deviation() {
        let random = Random::from_keys(&[3]);
        let points: Vec<Vec<f64>> = (0..60).map(|i| (0..2).map(|k| random.stream(k).normal(i)).collect()).collect();
        let truth = |p: &[f64]| vec![(p[0] + 0.3 * p[1]).sin(), p[0] * p[1]];
        let values: Vec<Vec<f64>> = points.iter().map(|p| truth(p)).collect();
        let emulator = Emulator::through(&points, &values).unwrap();
        for i in 100..120 {
            let at: Vec<f64> = (0..2).map(|k| 0.7 * random.stream(k).normal(i)).collect();
            let predicted = emulator.at(&at);
            let off = predicted.mean.iter().zip(truth(&at)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 0.05, "{off} at {at:?}");
            assert!(off < 5.0 * predicted.variance.sqrt() + 1e-3);
        }
    }

    #[test]
    fn what_is_far_from_points_and_from_each_other_is_chosen() {
        let random = Random::from_keys(&[4]);
        let points: Vec<Vec<f64>> = (0..40).map(|i| (0..2).map(|k| random.stream(k).normal(i)).collect()).collect();
        let values: Vec<Vec<f64>> = points.iter().map(|p| vec![(2.0 * p[0]).sin() * p[1]]).collect();
        let emulator = Emulator::through(&points, &values).unwrap();
        let candidates = vec![points[3].clone(), vec![4.0, 4.0], vec![4.1, 4.0], vec![-3.5, 3.0], points[7].clone()];
        let mut chosen = emulator.most_uncertain(&candidates, 2);
        chosen.sort_unstable();
        assert!(chosen == [1, 3] || chosen == [2, 3], "{chosen:?}");
    }
}
