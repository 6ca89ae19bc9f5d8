//! Counts of events that real tissue would not survive.

use crate::channels::TaskChannels;
use serde::{Deserialize, Serialize};
use std::iter::Sum;

/// Events that real tissue would not survive, in an episode or in many. Physics continues. The more
/// there are, the less the motion is that of tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Warnings {
    /// Times that an instrument punctured an organ.
    pub punctures: usize,
    /// Times that the axis of an instrument came into an organ that its jaws did not hold, with
    /// less force than punctures it.
    pub pierced: usize,
    /// Times that an instrument began to strain tissue beyond its limits.
    pub overstretched: usize,
    /// Times that an organ stayed strained with no instrument at it.
    pub folded: usize,
}

impl Warnings {
    /// The meaning of the four numbers of [`Display`](std::fmt::Display).
    pub const LEGEND: &str =
        "punctures / instruments that pierced an organ / organs overstretched / organs that stayed folded";

    /// Those of a control period.
    pub(crate) fn of(task: &TaskChannels) -> Self {
        let count = |n: f64| n as usize;
        Self {
            punctures: count(task.punctures),
            pierced: count(task.pierced),
            overstretched: count(task.overstretched),
            folded: count(task.folded),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// All of them as one number.
    pub fn total(&self) -> usize {
        self.punctures + self.pierced + self.overstretched + self.folded
    }

    /// In a few words; `None` if there are none.
    pub fn described(&self) -> Option<String> {
        let said = |n: usize, what: &str| match n {
            0 => None,
            1 => Some(format!("an instrument {what}")),
            n => Some(format!("instruments {what} {n} times")),
        };
        let folded = match self.folded {
            0 => None,
            1 => Some("an organ stayed folded".to_owned()),
            n => Some(format!("organs stayed folded {n} times")),
        };
        let all = [
            said(self.punctures, "punctured an organ"),
            said(self.pierced, "pierced an organ"),
            said(self.overstretched, "overstretched an organ"),
            folded,
        ];
        let all: Vec<String> = all.into_iter().flatten().collect();
        (!all.is_empty()).then(|| all.join(", "))
    }
}

impl Sum for Warnings {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, own| Self {
            punctures: sum.punctures + own.punctures,
            pierced: sum.pierced + own.pierced,
            overstretched: sum.overstretched + own.overstretched,
            folded: sum.folded + own.folded,
        })
    }
}

impl std::fmt::Display for Warnings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}/{}", self.punctures, self.pierced, self.overstretched, self.folded)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_summed_and_said() {
        let one = Warnings { pierced: 1, overstretched: 2, ..Warnings::default() };
        let all: Warnings = [one, one].into_iter().sum();
        assert_eq!((all.to_string().as_str(), all.total(), all.is_empty()), ("0/2/4/0", 6, false));
        assert_eq!(
            one.described().unwrap(),
            "an instrument pierced an organ, instruments overstretched an organ 2 times"
        );
        assert_eq!(Warnings::default().described(), None);
    }
}
