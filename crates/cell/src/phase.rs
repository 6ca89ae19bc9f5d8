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
    /// With a cut: the open cutter comes to the tissue between the grasp and what holds the organ.
    Reach,
    /// Its blades close.
    Snip,
    /// What came loose is lifted on; the cutter withdraws.
    Carry,
    /// All stay where they are.
    Keep,
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
            Self::Reach => "reach",
            Self::Snip => "snip",
            Self::Carry => "carry",
            Self::Keep => "keep",
        }
    }

    /// The phases of a task that drags and grasps again or does not, and cuts what it lifted,
    /// lowers it, or ends with the hold.
    pub(crate) fn sequence(regrasp: bool, lower: bool, sever: bool) -> Vec<Self> {
        let mut all = vec![Self::Settle, Self::Approach, Self::Close];
        if regrasp {
            all.extend([Self::Drag, Self::Release, Self::Close]);
        }
        all.extend([Self::Lift, Self::Hold]);
        if sever {
            all.extend([Self::Reach, Self::Snip, Self::Carry, Self::Keep]);
        } else if lower {
            all.extend([Self::Lower, Self::Open]);
        }
        all
    }

    /// How long it takes [s].
    fn seconds(self) -> f64 {
        match self {
            Self::Settle | Self::Lift | Self::Hold | Self::Lower | Self::Carry => 1.0,
            Self::Approach => 0.25,
            Self::Close | Self::Drag | Self::Release | Self::Open | Self::Reach | Self::Snip | Self::Keep => 0.5,
        }
    }

    /// The same in frames.
    pub(crate) fn frames(self) -> usize {
        (self.seconds() / FRAME).round() as usize
    }
}
