//! How episodes end.

use serde::{Deserialize, Serialize};

/// How an episode ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum End {
    /// All stages are passed.
    Passed,
    /// The scene's time is up.
    TimeOut,
    /// The RCM deviation went beyond that at which hardware stops.
    RcmAbort {
        /// The arm.
        arm: String,
        /// The deviation (mm).
        deviation_mm: f64,
    },
    /// Tissue or an arm is lost.
    Diverged {
        /// Why.
        why: String,
    },
    /// An abort condition of the task held.
    Aborted {
        /// Its name.
        name: String,
    },
    /// The policy had nothing left to do, and not all stages are passed.
    Finished,
    /// The policy gave no action that could be done.
    PolicyError {
        /// What was wrong with it.
        why: String,
    },
}

impl End {
    /// Its name in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::TimeOut => "time-out",
            Self::RcmAbort { .. } => "rcm-abort",
            Self::Diverged { .. } => "diverged",
            Self::Aborted { .. } => "aborted",
            Self::Finished => "finished",
            Self::PolicyError { .. } => "policy-error",
        }
    }
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Passed => write!(f, "all stages passed"),
            Self::TimeOut => write!(f, "the time was up"),
            Self::RcmAbort { arm, deviation_mm } => {
                write!(f, "the {arm} RCM deviation of {deviation_mm:.2} mm is where hardware stops")
            }
            Self::Diverged { why } => write!(f, "diverged: {why}"),
            Self::Aborted { name } => write!(f, "aborted by the task: {name}"),
            Self::Finished => write!(f, "the policy had finished"),
            Self::PolicyError { why } => write!(f, "the policy failed: {why}"),
        }
    }
}
