//! The options of a scripted grasp-lift: its place, its height and its end.

use crate::{Error, Result};

/// Where a [`Script`] cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CutAt {
    /// Half way between the grasp and the pinned part.
    Between,
    /// At an organ coordinate, 0 to 1.
    S(f64),
}

/// The actions of a [`Script`] after its hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AfterHold {
    /// Nothing: it is finished.
    #[default]
    Finish,
    /// Lowers the tissue, releases it and finishes.
    Lower,
    /// Cuts the organ between the grasp and its attachment, carries the loose piece further and
    /// finishes.
    Cut(CutAt),
}

/// A grasp-lift with its own place, height and end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Script {
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// How far beside the tissue's middle the jaws come (m), across the organ.
    pub approach_offset: f64,
    /// Lift of the jaws (m), in one second and held for another.
    pub lift: f64,
    /// The jaws first drag the tissue sideways by this much (m), release it there and close again.
    pub regrasp: Option<f64>,
    /// Number of further tries after jaws closed on nothing.
    pub retries: usize,
    /// The actions after the hold.
    pub after: AfterHold,
}

impl Default for Script {
    fn default() -> Self {
        Self { at: 0.5, approach_offset: 0.0, lift: 0.015, regrasp: None, retries: 0, after: AfterHold::default() }
    }
}

impl Script {
    /// Says which option is out of range.
    ///
    /// # Errors
    /// The option by its name on the command line.
    pub fn check(&self) -> Result<()> {
        let within = |name: &str, value: f64, low: f64, high: f64, unit: &str| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::Option(format!("{name} is {value}{unit}; must be in [{low}, {high}]{unit}")))
        };
        within("--at", self.at, 0.0, 1.0, "")?;
        within("--lift", 1e3 * self.lift, 0.1, 100.0, " mm")?;
        within("--approach-offset", 1e3 * self.approach_offset, -50.0, 50.0, " mm")?;
        within("--regrasp", 1e3 * self.regrasp.unwrap_or(0.0), -50.0, 50.0, " mm")?;
        match self.after {
            AfterHold::Cut(CutAt::S(s)) => within("--sever", s, 0.0, 1.0, ""),
            _ => Ok(()),
        }
    }
}
