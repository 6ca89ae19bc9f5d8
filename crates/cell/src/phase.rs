//! The phases of a grasp-lift.

use crate::FRAME;

/// The phases of the task, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The organs come to rest under gravity.
    Settle,
    /// The open gripper comes down.
    Approach,
    /// The jaws close.
    Close,
    /// Of a re-grasp: the jaws drag what they hold sideways.
    Drag,
    /// Of a re-grasp: they open there, and close once more.
    Release,
    /// The jaws rise.
    Lift,
    /// They stay up.
    Hold,
    /// They come down.
    Lower,
    /// They open and the tissue is free again.
    Open,
}

impl Phase {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Settle => "settle",
            Self::Approach => "approach",
            Self::Close => "close",
            Self::Drag => "drag",
            Self::Release => "release",
            Self::Lift => "lift",
            Self::Hold => "hold",
            Self::Lower => "lower",
            Self::Open => "open",
        }
    }

    /// The phases of a task that drags and grasps again or does not, and lowers what it lifted or ends with the hold.
    pub(crate) fn sequence(regrasp: bool, lower: bool) -> Vec<Self> {
        let mut all = vec![Self::Settle, Self::Approach, Self::Close];
        if regrasp {
            all.extend([Self::Drag, Self::Release, Self::Close]);
        }
        all.extend([Self::Lift, Self::Hold]);
        if lower {
            all.extend([Self::Lower, Self::Open]);
        }
        all
    }

    /// How long it takes [s].
    fn seconds(self) -> f64 {
        match self {
            Self::Settle | Self::Lift | Self::Hold | Self::Lower => 1.0,
            Self::Approach => 0.25,
            Self::Close | Self::Drag | Self::Release | Self::Open => 0.5,
        }
    }

    /// The same in frames.
    pub(crate) fn frames(self) -> usize {
        (self.seconds() / FRAME).round() as usize
    }
}
