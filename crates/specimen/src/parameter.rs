//! What of an organ can be identified, and in which range.

use serde::{Deserialize, Serialize};

/// Steepness of the logistic curve that maps scores to shares of a range: a score of mean 0 and
/// deviation 1 is then nearly uniform over the range.
const STEEPNESS: f64 = 1.702;

/// A property of an organ that is identified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Organ coordinate up to which the base is held.
    BaseLength,
    /// Organ coordinate from which threads hold the organ up to its tip.
    ThreadsFrom,
    /// Length up to which these are slack (m).
    #[serde(rename = "threads_slack_m")]
    ThreadsSlack,
    /// Their stiffness per length of the organ (N/m2).
    #[serde(rename = "threads_stiffness_n_m2")]
    ThreadsStiffness,
    /// Young's modulus (Pa).
    #[serde(rename = "young_modulus_pa")]
    YoungModulus,
    /// Poisson's ratio.
    PoissonRatio,
}

/// How the values of a range are spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Their logarithms evenly.
    Log,
}

impl Parameter {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::BaseLength,
        Self::ThreadsFrom,
        Self::ThreadsSlack,
        Self::ThreadsStiffness,
        Self::YoungModulus,
        Self::PoissonRatio,
    ];

    /// Its name in files, which ends in its unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseLength => "base_length",
            Self::ThreadsFrom => "threads_from",
            Self::ThreadsSlack => "threads_slack_m",
            Self::ThreadsStiffness => "threads_stiffness_n_m2",
            Self::YoungModulus => "young_modulus_pa",
            Self::PoissonRatio => "poisson_ratio",
        }
    }

    /// The parameter of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// Its name for people, and its unit with the factor to it.
    pub fn said(self) -> (&'static str, &'static str, f64) {
        match self {
            Self::BaseLength => ("held base", "of the length", 1.0),
            Self::ThreadsFrom => ("threads from", "of the length", 1.0),
            Self::ThreadsSlack => ("slack of threads", "mm", 1e3),
            Self::ThreadsStiffness => ("stiffness of threads", "N/m2", 1.0),
            Self::YoungModulus => ("Young's modulus", "kPa", 1e-3),
            Self::PoissonRatio => ("Poisson's ratio", "", 1.0),
        }
    }

    /// How its values are spread.
    pub fn scale(self) -> Scale {
        match self {
            Self::ThreadsStiffness | Self::YoungModulus => Scale::Log,
            _ => Scale::Linear,
        }
    }

    /// The widest range that it may have.
    pub fn limits(self) -> [f64; 2] {
        match self {
            Self::BaseLength | Self::ThreadsFrom => [0.0, 0.99],
            Self::ThreadsSlack => [0.0, 0.2],
            Self::ThreadsStiffness => [1e-3, 1e6],
            Self::YoungModulus => [100.0, 1e7],
            Self::PoissonRatio => [0.0, 0.4999],
        }
    }

    /// The value of a score within a range: the logistic curve of the score is the share of the
    /// range, or of its logarithm.
    pub fn value(self, range: [f64; 2], score: f64) -> f64 {
        let share = 1.0 / (1.0 + libm::exp(-STEEPNESS * score));
        let [low, high] = range;
        match self.scale() {
            Scale::Linear => low + share * (high - low),
            Scale::Log => low * libm::exp(share * libm::log(high / low)),
        }
    }

    /// The score of a value within a range; at its ends as far as a score of 4.
    pub fn score(self, range: [f64; 2], value: f64) -> f64 {
        let [low, high] = range;
        let share = match self.scale() {
            Scale::Linear => (value - low) / (high - low),
            Scale::Log => libm::log(value / low) / libm::log(high / low),
        };
        (libm::log(share / (1.0 - share)) / STEEPNESS).clamp(-4.0, 4.0)
    }
}
