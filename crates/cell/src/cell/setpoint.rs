//! The five numbers of an arm: its commands and its measurements.

use trocar_core::interpolate::linear;
use trocar_robot::instrument::Coordinates;

/// Numbers of an arm in an action.
pub const NUMBERS: usize = 5;

/// Five numbers of an arm, in the order of an action.
///
/// The fourth is the turn about the shaft (rad), the fifth the opening of the jaw, 0 closed to 1.
/// The arm's [`Workspace`](crate::Workspace) says what the first three are: two pivots (rad) and
/// the insertion (m) in a port, or the place of the jaw's pivot in the cell (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint(pub [f64; NUMBERS]);

impl Setpoint {
    /// Turn about the shaft (rad).
    pub fn roll(&self) -> f64 {
        self.0[3]
    }

    /// Opening of the jaw, 0 closed to 1.
    pub fn jaw(&self) -> f64 {
        self.0[4]
    }

    /// The same with another roll (rad).
    #[must_use]
    pub fn with_roll(mut self, roll: f64) -> Self {
        self.0[3] = roll;
        self
    }

    /// The same with another opening of the jaw.
    #[must_use]
    pub fn with_jaw(mut self, jaw: f64) -> Self {
        self.0[4] = jaw;
        self
    }

    /// Interpolates to `to` with `share` from 0 to 1. The jaw is that of `to`.
    #[must_use]
    pub fn towards(&self, to: &Self, share: f64) -> Self {
        let part = |k: usize| linear(self.0[k], to.0[k], share);
        Self([part(0), part(1), part(2), part(3), to.jaw()])
    }

    /// As coordinates in a port; meaningless for an arm without one.
    pub(crate) fn in_port(&self) -> Coordinates {
        let [first, second, insertion, roll, jaw] = self.0;
        Coordinates { pivots: [first, second], insertion, roll, jaw }
    }
}

impl From<Coordinates> for Setpoint {
    fn from(coordinates: Coordinates) -> Self {
        Self(coordinates.to_action())
    }
}

/// Checks that a number is in its range, up to rounding. The error is its index and what would be
/// right.
pub(super) fn in_range(
    k: usize,
    value: f64,
    [low, high]: [f64; 2],
    unit: &str,
) -> std::result::Result<(), (usize, String)> {
    if value >= low - 1e-9 && value <= high + 1e-9 {
        return Ok(());
    }
    Err((k, format!("is {value}{unit}; must be in [{low:.4}, {high:.4}]{unit}")))
}
