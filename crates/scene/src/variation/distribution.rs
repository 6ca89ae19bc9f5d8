//! Distributions from which a factor's value is drawn.

use crate::EpisodeRandom;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Beyond so many standard deviations nothing is drawn.
const MAX_DEVIATIONS: f64 = 3.0;

/// A distribution of one number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Evenly to either side of 0, by at most this.
    Within(f64),
    /// Evenly between two numbers.
    Uniform([f64; 2]),
    /// Evenly in the logarithm, between two numbers above 0.
    LogUniform([f64; 2]),
    /// Mean and standard deviation of a normal distribution, cut off at three deviations.
    Normal([f64; 2]),
    /// One of these, each as likely.
    Choice(Vec<f64>),
}

impl Distribution {
    /// The number at `index` of `random`.
    pub fn draw(&self, random: &EpisodeRandom, index: u64) -> f64 {
        match self {
            Self::Within(most) => random.aside(index, *most),
            Self::Uniform([low, high]) => random.within(index, *low, *high),
            Self::LogUniform([low, high]) => libm::exp(random.within(index, libm::log(*low), libm::log(*high))),
            Self::Normal([mean, deviation]) => {
                mean + deviation * random.normal(index).clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS)
            }
            Self::Choice(values) => {
                let at = (random.unit(index) * values.len() as f64) as usize;
                values.get(at).or(values.last()).copied().unwrap_or_default()
            }
        }
    }

    /// The smallest and the largest number that it gives.
    pub fn range(&self) -> [f64; 2] {
        match self {
            Self::Within(most) => [-most.abs(), most.abs()],
            Self::Uniform([a, b]) | Self::LogUniform([a, b]) => [a.min(*b), a.max(*b)],
            Self::Normal([mean, deviation]) => {
                let reach = MAX_DEVIATIONS * deviation.abs();
                [mean - reach, mean + reach]
            }
            Self::Choice(values) => {
                let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                [low, values.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
            }
        }
    }

    /// The error in its parameters, in words that follow the factor's name.
    pub(crate) fn mistake(&self) -> Option<String> {
        let finite = match self {
            Self::Within(most) => most.is_finite(),
            Self::Uniform(pair) | Self::LogUniform(pair) | Self::Normal(pair) => pair.iter().all(|v| v.is_finite()),
            Self::Choice(values) => values.iter().all(|v| v.is_finite()),
        };
        let wrong = match self {
            _ if !finite => "has a number that is not finite",
            Self::Within(most) if *most < 0.0 => "has a negative `within`; it goes to either side",
            Self::Uniform([low, high]) | Self::LogUniform([low, high]) if low > high => {
                "has its larger number first; the smaller one comes first"
            }
            Self::LogUniform([low, _]) if *low <= 0.0 => "has a `log_uniform` from 0 or less; it starts above 0",
            Self::Normal([_, deviation]) if *deviation < 0.0 => "has a negative standard deviation",
            Self::Choice(values) if values.is_empty() => "has an empty `choice`; it lists one number or more",
            _ => return None,
        };
        Some(format!(" {wrong}"))
    }

    /// Whether it gives more than one number.
    pub fn varies(&self) -> bool {
        let [low, high] = self.range();
        low < high
    }
}

impl JsonSchema for Distribution {
    fn schema_name() -> Cow<'static, str> {
        "Distribution".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let number = || serde_json::json!({ "type": "number" });
        let list = |said: &str, fewest: u32, most: Option<u32>| {
            let mut list = serde_json::json!({
                "description": said, "type": "array", "items": number(), "minItems": fewest
            });
            if let Some(most) = most {
                list["maxItems"] = most.into();
            }
            list
        };
        json_schema!({
            "description": "A distribution of one number; one of the keys.",
            "type": "object",
            "minProperties": 1,
            "maxProperties": 1,
            "additionalProperties": false,
            "properties": {
                "within": {
                    "description": "Evenly to either side of 0, by at most this.", "type": "number", "minimum": 0
                },
                "uniform": list("Evenly between two numbers.", 2, Some(2)),
                "log_uniform": list("Evenly in the logarithm, between two numbers above 0.", 2, Some(2)),
                "normal": list(
                    "Mean and standard deviation of a normal distribution, cut off at three deviations.", 2, Some(2)
                ),
                "choice": list("One of these, each as likely.", 1, None),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_stay_in_range_and_have_their_means() {
        let random = EpisodeRandom::new(5, "test");
        let mean = |d: &Distribution| (0..20_000).map(|k| d.draw(&random, k)).sum::<f64>() / 20_000.0;
        let log_mean = (48.0 - 3.0) / (48.0_f64 / 3.0).ln();
        for (distribution, expected, tolerance) in [
            (Distribution::Within(8.0), 0.0, 0.1),
            (Distribution::Uniform([0.2, 0.6]), 0.4, 0.01),
            (Distribution::LogUniform([3.0, 48.0]), log_mean, 0.3),
            (Distribution::Normal([1.0, 0.1]), 1.0, 0.01),
            (Distribution::Choice(vec![3.0, 6.0, 12.0]), 7.0, 0.1),
        ] {
            let [low, high] = distribution.range();
            assert!((0..20_000).all(|k| (low..=high).contains(&distribution.draw(&random, k))), "{distribution:?}");
            assert!((mean(&distribution) - expected).abs() < tolerance, "{distribution:?}: {}", mean(&distribution));
            assert!(distribution.mistake().is_none() && distribution.varies());
        }
        assert!(!Distribution::Within(0.0).varies());
    }

    #[test]
    fn mistakes_are_named() {
        for (bad, why) in [
            (Distribution::Within(-1.0), "negative"),
            (Distribution::Uniform([2.0, 1.0]), "larger number first"),
            (Distribution::LogUniform([0.0, 1.0]), "above 0"),
            (Distribution::Normal([0.0, -1.0]), "negative"),
            (Distribution::Choice(Vec::new()), "empty"),
            (Distribution::Uniform([f64::NAN, 1.0]), "finite"),
        ] {
            assert!(bad.mistake().is_some_and(|m| m.contains(why)), "{bad:?}");
        }
    }
}
