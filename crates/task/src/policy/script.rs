//! What a scripted grasp-lift is asked for: its place, its height and its end.

use crate::{Error, Result};

/// Where a [`Script`] cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CutAt {
    /// Half way between the grasp and the pinned part.
    Between,
    /// At an organ coordinate, 0 to 1.
    S(f64),
}

/// What a [`Script`] does after its hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AfterHold {
    /// Nothing: it is finished.
    #[default]
    Finish,
    /// Lowers what was lifted, lets go of it and is finished.
    Lower,
    /// Cuts the organ between the grasp and what holds it, carries on what came loose and is
    /// finished.
    Cut(CutAt),
}

/// A grasp-lift with a place, a height and an end of its own choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Script {
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// How far beside the tissue's middle the jaws come (m), across the organ.
    pub approach_offset: f64,
    /// Lift of the jaws (m), in one second and held for another.
    pub lift: f64,
    /// The jaws first drag the tissue sideways by this much (m), let go of it there and close
    /// again.
    pub regrasp: Option<f64>,
    /// Times that it tries again where the jaws took hold of nothing.
    pub retries: usize,
    /// What follows the hold.
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
