//! Coordinates of an instrument in its port, in the order of an action, and their limits.

use crate::error::within;
use crate::{Error, Result};
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Coordinates of an instrument in its port: commands and measurements of an arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coordinates {
    /// The two pivot angles (rad): the first about the port's x, the second about the rotated y.
    pub pivots: [f64; 2],
    /// Distance from the port's centre to the jaw's pivot (m), along the shaft.
    pub insertion: f64,
    /// Rotation of the instrument about its shaft (rad).
    pub roll: f64,
    /// Jaw opening, from 0 (closed) to 1 (open).
    pub jaw: f64,
}

impl Coordinates {
    /// The five numbers of an action: pivots (rad), insertion (m), roll (rad), jaw.
    pub fn to_action(&self) -> [f64; 5] {
        [self.pivots[0], self.pivots[1], self.insertion, self.roll, self.jaw]
    }

    /// From five numbers of an action.
    ///
    /// # Errors
    /// A number that is not finite, by its name.
    pub fn from_action(action: [f64; 5]) -> Result<Self> {
        const NAMES: [&str; 5] = ["first pivot", "second pivot", "insertion", "roll", "jaw"];
        if let Some(k) = action.iter().position(|a| !a.is_finite()) {
            return Err(Error::invalid(
                format!("action, {}", NAMES[k]),
                format!("is {}; it must be finite", action[k]),
            ));
        }
        let [first, second, insertion, roll, jaw] = action;
        Ok(Self { pivots: [first, second], insertion, roll, jaw })
    }

    /// Direction of the shaft in the port's frame: z rotated by the pivots.
    pub(crate) fn direction(pivots: [f64; 2]) -> glam::DVec3 {
        let (sa, ca) = libm::sincos(pivots[0]);
        let (sb, cb) = libm::sincos(pivots[1]);
        glam::DVec3::new(sb, -sa * cb, ca * cb)
    }

    /// Angle between the shaft and the port's normal (rad).
    pub fn tilt(&self) -> f64 {
        let u = Self::direction(self.pivots);
        libm::atan2(DVec2::new(u.x, u.y).length(), u.z)
    }
}

/// Limits of an instrument in a port. The tilt limits both pivots together, because the hole is
/// round.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Maximum tilt (rad).
    pub tilt: f64,
    /// Minimum and maximum insertion (m).
    pub insertion: [f64; 2],
    /// Minimum and maximum roll (rad).
    pub roll: [f64; 2],
}

/// By how much coordinates exceed their limits: 0 inside, positive above the upper limit, negative
/// below the lower one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Excess {
    /// Of the tilt (rad).
    pub tilt: f64,
    /// Of the insertion (m).
    pub insertion: f64,
    /// Of the roll (rad).
    pub roll: f64,
    /// Of the jaw's opening.
    pub jaw: f64,
}

impl Excess {
    /// Whether any limit binds.
    pub fn any(&self) -> bool {
        *self != Self::default()
    }

    /// The names of the binding limits, with the excess in SI units.
    pub fn binding(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let all = [("tilt", self.tilt), ("insertion", self.insertion), ("roll", self.roll), ("jaw", self.jaw)];
        all.into_iter().filter(|(_, excess)| *excess != 0.0)
    }
}

impl Limits {
    /// Checks the limits.
    ///
    /// # Errors
    /// A tilt of 0, or of 80 degrees and more (the second pivot is singular at 90), an empty range,
    /// an insertion that is not positive, a number that is not finite.
    pub fn check(&self) -> Result<()> {
        within("limits, tilt", self.tilt, 1e-3, 80_f64.to_radians(), "rad")?;
        within("limits, insertion[0]", self.insertion[0], 1e-3, 2.0, "m")?;
        within("limits, insertion[1]", self.insertion[1], self.insertion[0], 2.0, "m")?;
        within("limits, roll[0]", self.roll[0], -100.0, 100.0, "rad")?;
        within("limits, roll[1]", self.roll[1], self.roll[0], 100.0, "rad")?;
        Ok(())
    }

    /// The nearest coordinates within the limits, and the excess. Too large a tilt is reduced in
    /// its own direction, which keeps continuous motions continuous. Numbers that are not finite
    /// stay so.
    pub fn clamp(&self, wanted: &Coordinates) -> (Coordinates, Excess) {
        let mut excess = Excess::default();
        let mut clamped = *wanted;
        let tilt = wanted.tilt();
        if tilt > self.tilt {
            excess.tilt = tilt - self.tilt;
            let u = Coordinates::direction(wanted.pivots);
            let away = DVec2::new(u.x, u.y).try_normalize().unwrap_or(DVec2::X);
            clamped.pivots = pivots(away * libm::sin(self.tilt), libm::cos(self.tilt));
        }
        (clamped.insertion, excess.insertion) = clamp_with_excess(wanted.insertion, self.insertion);
        (clamped.roll, excess.roll) = clamp_with_excess(wanted.roll, self.roll);
        (clamped.jaw, excess.jaw) = clamp_with_excess(wanted.jaw, [0.0, 1.0]);
        (clamped, excess)
    }
}

/// `value` clamped to [`low`, `high`], and its excess.
pub(crate) fn clamp_with_excess(value: f64, [low, high]: [f64; 2]) -> (f64, f64) {
    let kept = value.max(low).min(high);
    if value.is_nan() { (value, value) } else { (kept, value - kept) }
}

/// The pivots that rotate the port's z to a direction, given by its part in the port's plane and
/// its positive part along z.
pub(crate) fn pivots(across: DVec2, along: f64) -> [f64; 2] {
    [libm::atan2(-across.y, along), libm::atan2(across.x, libm::hypot(across.y, along))]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { tilt: 0.5, insertion: [0.02, 0.3], roll: [-2.0, 2.0] };

    #[test]
    fn coordinates_within_limits_do_not_change() {
        let c = Coordinates { pivots: [0.3, -0.2], insertion: 0.1, roll: -1.9, jaw: 0.5 };
        let (clamped, excess) = LIMITS.clamp(&c);
        assert_eq!((clamped, excess.any()), (c, false));
        assert_eq!(Coordinates::from_action(c.to_action()).unwrap(), c);
    }

    #[test]
    fn coordinates_beyond_limits_are_clamped_with_their_excess() {
        let c = Coordinates { pivots: [0.6, -0.5], insertion: 0.4, roll: -2.5, jaw: 1.2 };
        let (clamped, excess) = LIMITS.clamp(&c);
        assert!((clamped.tilt() - 0.5).abs() < 1e-12);
        let (a, b) = (Coordinates::direction(c.pivots), Coordinates::direction(clamped.pivots));
        assert!((a.x * b.y - a.y * b.x).abs() < 1e-12, "the direction of the tilt stays");
        assert!((excess.tilt - (c.tilt() - 0.5)).abs() < 1e-12);
        assert!((excess.insertion - 0.1).abs() < 1e-12 && (excess.roll + 0.5).abs() < 1e-12);
        assert_eq!(excess.binding().map(|b| b.0).collect::<Vec<_>>(), ["tilt", "insertion", "roll", "jaw"]);
    }

    #[test]
    fn numbers_that_are_not_finite_are_named() {
        let e = Coordinates::from_action([0.0, 0.0, f64::NAN, 0.0, 0.0]).unwrap_err().to_string();
        assert!(e.contains("insertion"), "{e}");
        assert!(Limits { tilt: 1.5, ..LIMITS }.check().is_err());
        assert!(Limits { insertion: [0.2, 0.1], ..LIMITS }.check().is_err());
        assert!(Limits { roll: [f64::NAN, 1.0], ..LIMITS }.check().is_err());
        LIMITS.check().unwrap();
    }
}
