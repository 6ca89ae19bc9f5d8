//! Threads that hold a part of an organ: a mesentery or an adhesion that the camera does not see.

use serde::{Deserialize, Serialize};

/// Threads from the lowest nodes along a part of an organ to where these were recorded. A thread
/// is slack up to its length and pulls beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Threads {
    /// First organ coordinate that they hold.
    pub from: f64,
    /// Last organ coordinate that they hold.
    pub to: f64,
    /// Length up to which they are slack (m).
    pub slack_m: f64,
    /// Their stiffness per length of the organ (N/m2).
    pub stiffness_n_m2: f64,
}

impl Threads {
    /// Checks the ranges.
    ///
    /// # Errors
    /// "field is value; what would be right".
    pub fn validate(&self) -> Result<(), String> {
        let Self { from, to, slack_m, stiffness_n_m2 } = *self;
        if !(0.0..=1.0).contains(&from) {
            return Err(format!("from is {from}; it must be in [0, 1]"));
        }
        if !(from < to && to <= 1.0) {
            return Err(format!("to is {to}; it must be above from ({from}) and at most 1"));
        }
        if !(0.0..=0.2).contains(&slack_m) {
            return Err(format!("slack_m is {slack_m}; it must be in [0, 0.2] m"));
        }
        if !(0.0..=1e6).contains(&stiffness_n_m2) {
            return Err(format!("stiffness_n_m2 is {stiffness_n_m2}; it must be in [0, 1e6] N/m2"));
        }
        Ok(())
    }
}
