//! What lifts tell about an organ: a distribution over its support and its tissue.

use crate::parameter::{Parameter, Scale};
use serde::{Deserialize, Serialize};

/// The score of the ends of a 90% interval of a normal distribution.
pub const NINETY: f64 = 1.644_853_626_951_472_7;

/// Largest difference of two elements of a covariance that are to be the same.
const SYMMETRY: f64 = 1e-9;

/// A normal distribution over the scores of parameters, with the data that it comes from.
///
/// A score maps to a value by [`Parameter::value`]. The prior of a score is normal with mean 0 and
/// deviation 1: values are then spread nearly evenly over the prior's range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Posterior {
    /// The recording that the lifts are of.
    pub recording: String,
    /// The numbers of the lifts in it.
    pub lifts: Vec<usize>,
    /// Landmark error of the mean over these lifts (mm).
    pub landmark_rmse_mm: f64,
    /// Mean scores, in the order of the parameters.
    pub mean: Vec<f64>,
    /// Their covariance.
    pub covariance: Vec<Vec<f64>>,
    /// The parameters with their ranges.
    #[serde(rename = "parameter")]
    pub parameters: Vec<Prior>,
}

/// A parameter with the range that was thought possible before the lifts, and what they tell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// The parameter.
    pub name: Parameter,
    /// Its range.
    pub range: [f64; 2],
    /// The 5%, 50% and 95% quantiles of its value.
    pub interval: [f64; 3],
    /// Width of the 90% interval over that of the prior; of logarithms where these are spread
    /// evenly.
    pub width: f64,
}

impl Posterior {
    /// Whether lifts tell a parameter: its 90% interval is at most half as wide as the prior's.
    pub fn is_identified(prior: &Prior) -> bool {
        prior.width <= 0.5
    }

    /// The interval and width of each parameter, from mean and covariance.
    pub fn summarise(&mut self) {
        for (k, prior) in self.parameters.iter_mut().enumerate() {
            let (mean, deviation) = (self.mean[k], self.covariance[k][k].max(0.0).sqrt());
            let at = |score: f64| prior.name.value(prior.range, mean + score * deviation);
            let [low, high] = [at(-NINETY), at(NINETY)];
            let [least, most] = [-NINETY, NINETY].map(|score| prior.name.value(prior.range, score));
            prior.interval = [low, at(0.0), high];
            prior.width = match prior.name.scale() {
                Scale::Linear => (high - low) / (most - least),
                Scale::Log => libm::log(high / low) / libm::log(most / least),
            };
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// "field is value; what would be right".
    pub fn validate(&self) -> Result<(), String> {
        let count = self.parameters.len();
        if count == 0 {
            return Err("parameter is empty; there must be at least one".to_owned());
        }
        for (k, prior) in self.parameters.iter().enumerate() {
            let (name, [low, high]) = (prior.name.name(), prior.range);
            if self.parameters[..k].iter().any(|p| p.name == prior.name) {
                return Err(format!("parameter '{name}' is there twice; it must be there once"));
            }
            let [least, most] = prior.name.limits();
            let rises = least <= low && low < high && high <= most;
            if !rises {
                return Err(format!(
                    "parameter '{name}' has the range [{low}, {high}]; it must rise within [{least}, {most}]"
                ));
            }
            if !prior.interval.iter().chain([&prior.width]).all(|v| v.is_finite()) {
                return Err(format!("parameter '{name}' has an interval or width that is no number"));
            }
        }
        if self.mean.len() != count || !self.mean.iter().all(|m| m.is_finite()) {
            return Err(format!("mean is {:?}; it must have {count} numbers, one a parameter", self.mean));
        }
        let rows = &self.covariance;
        if rows.len() != count || rows.iter().any(|r| r.len() != count || !r.iter().all(|c| c.is_finite())) {
            return Err(format!("covariance must have {count} rows of {count} numbers, one a parameter"));
        }
        for i in 0..count {
            for j in 0..i {
                if (rows[i][j] - rows[j][i]).abs() > SYMMETRY {
                    return Err(format!(
                        "covariance[{i}][{j}] is {} and covariance[{j}][{i}] is {}; it must be symmetric",
                        rows[i][j], rows[j][i]
                    ));
                }
            }
        }
        self.factor().map(|_| ()).ok_or_else(|| "covariance has a negative direction; it must have none".to_owned())
    }

    /// The lower triangular factor of the covariance (Cholesky); None if there is none.
    fn factor(&self) -> Option<Vec<Vec<f64>>> {
        let count = self.covariance.len();
        let mut factor = vec![vec![0.0; count]; count];
        for i in 0..count {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                let left = self.covariance[i][j] - known;
                factor[i][j] = match (i == j, factor[j][j]) {
                    (true, _) if left < -SYMMETRY => return None,
                    (true, _) => left.max(0.0).sqrt(),
                    (false, pivot) if pivot > 1e-12 => left / pivot,
                    (false, _) => 0.0,
                };
            }
        }
        Some(factor)
    }

    /// One draw: the parameters with their values. `normals` are standard normal numbers, one a
    /// parameter.
    pub fn draw(&self, normals: &[f64]) -> Vec<(Parameter, f64)> {
        let factor = self.factor().unwrap_or_else(|| vec![vec![0.0; self.mean.len()]; self.mean.len()]);
        let score = |k: usize| self.mean[k] + factor[k].iter().zip(normals).map(|(l, n)| l * n).sum::<f64>();
        let value = |(k, prior): (usize, &Prior)| (prior.name, prior.name.value(prior.range, score(k)));
        self.parameters.iter().enumerate().map(value).collect()
    }

    /// The values of the mean.
    pub fn middle(&self) -> Vec<(Parameter, f64)> {
        self.draw(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn posterior() -> Posterior {
        let prior = |name: Parameter, range| Prior { name, range, interval: [0.0; 3], width: 0.0 };
        let mut made = Posterior {
            recording: "film".to_owned(),
            lifts: vec![0, 2],
            landmark_rmse_mm: 1.2,
            mean: vec![0.5, -1.0],
            covariance: vec![vec![0.04, 0.03], vec![0.03, 0.8]],
            parameters: vec![prior(Parameter::BaseLength, [0.02, 0.4]), prior(Parameter::YoungModulus, [2e3, 1e5])],
        };
        made.summarise();
        made
    }

    #[test]
    fn scores_and_values_are_inverse() {
        for parameter in Parameter::ALL {
            let [low, high] = parameter.limits();
            let range = [low + 0.01 * (high - low), low + 0.6 * (high - low)];
            for score in [-2.0, -0.3, 0.0, 1.4] {
                let value = parameter.value(range, score);
                assert!(range[0] < value && value < range[1]);
                assert!((parameter.score(range, value) - score).abs() < 1e-9, "{}", parameter.name());
            }
        }
    }

    #[test]
    fn draws_have_the_mean_and_the_covariance() {
        let posterior = posterior();
        assert_eq!(posterior.validate(), Ok(()));
        assert!(Posterior::is_identified(&posterior.parameters[0]));
        assert!(!Posterior::is_identified(&posterior.parameters[1]));
        let scores = |values: Vec<(Parameter, f64)>| -> Vec<f64> {
            values.iter().zip(&posterior.parameters).map(|((p, v), prior)| p.score(prior.range, *v)).collect()
        };
        let middle = scores(posterior.middle());
        assert!(middle.iter().zip(&posterior.mean).all(|(a, b)| (a - b).abs() < 1e-9));
        let moved = scores(posterior.draw(&[1.0, 0.0]));
        assert!((moved[0] - 0.7).abs() < 1e-9 && (moved[1] - (-1.0 + 0.15)).abs() < 1e-9);
    }

    #[test]
    fn mistakes_are_named() {
        let mut lopsided = posterior();
        lopsided.covariance[0][1] = 0.5;
        assert!(lopsided.validate().unwrap_err().contains("must be symmetric"));
        let mut unknown = posterior();
        unknown.mean[1] = f64::NAN;
        assert!(unknown.validate().unwrap_err().starts_with("mean is"));
        let mut negative = posterior();
        negative.covariance = vec![vec![1.0, 2.0], vec![2.0, 1.0]];
        assert!(negative.validate().unwrap_err().contains("negative direction"));
        let mut twice = posterior();
        twice.parameters[1] = twice.parameters[0];
        assert!(twice.validate().unwrap_err().contains("twice"));
    }
}
