//! The phases of the scripted baseline, and their names in files.

/// A phase of the script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    Approach,
    Enter,
    /// Open blades back out of tissue that presses them apart.
    BackOut,
    /// Jaws that do not close on the tissue open again and back out a little: it keeps them open,
    /// or one blade alone presses on something else.
    BackOff,
    Close,
    Drag,
    Release,
    Lift,
    /// Further up, for tissue that has not risen enough.
    Rise,
    Hold,
    Lower,
    Open,
    Reach,
    Engage,
    Cut,
    Carry,
    Keep,
    /// Port-reach: both arms to this target.
    Target(usize),
    Rest,
    Finished,
}

impl Phase {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Enter | Self::BackOut | Self::BackOff => "enter",
            Self::Close => "close",
            Self::Drag => "drag",
            Self::Release => "release",
            Self::Lift | Self::Rise => "lift",
            Self::Hold => "hold",
            Self::Lower => "lower",
            Self::Open => "open",
            Self::Reach => "reach",
            Self::Engage => "engage",
            Self::Cut => "cut",
            Self::Carry => "carry",
            Self::Keep => "keep",
            Self::Target(_) => "target",
            Self::Rest => "rest",
            Self::Finished => "finished",
        }
    }
}
