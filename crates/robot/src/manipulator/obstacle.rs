//! Solid obstacles that an instrument presses on in a step: other instruments, the bed, tissue that
//! does not move.

use crate::{Error, Result};
use glam::DVec3;

/// Maximum number of obstacles in a step.
pub const MAX_OBSTACLES: usize = 8;

/// Tolerance of the length of a normal.
const UNIT: f64 = 1e-6;

/// A solid at a point of the instrument: a one-sided spring with a damper along its normal. Like
/// the port's rim it is implicit in the arm's motion, so no stiffness is too high for the step.
///
/// The force on the instrument along `normal` is the larger of 0 and -(`stiffness` x gap +
/// `damping` x rate of the gap), at the end of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    /// Where it touches the instrument (m), in the cell.
    pub point: DVec3,
    /// Unit vector in which it pushes the instrument, in the cell.
    pub normal: DVec3,
    /// Distance between both at the beginning of the step (m), negative where they press.
    pub gap: f64,
    /// Stiffness (N/m), positive.
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
    /// Speed of the obstacle along `normal` (m/s): positive if it comes nearer.
    pub speed: f64,
    /// Output: its mean force on the instrument over the step (N), not negative.
    pub force: f64,
}

impl Obstacle {
    /// Checks obstacle number `k` of a step.
    pub(super) fn check(&self, k: usize) -> Result<()> {
        let Self { point, normal, gap, stiffness, damping, speed, force: _ } = *self;
        let numbers = [gap, stiffness, damping, speed];
        if !(point.is_finite() && normal.is_finite() && numbers.iter().all(|n| n.is_finite())) {
            return Err(Error::NotFinite { what: "a number of an obstacle" });
        }
        let wrong = |reason: &str| Err(Error::invalid(format!("obstacle {k}"), reason));
        if (normal.length_squared() - 1.0).abs() > UNIT {
            return wrong("its normal must have length 1");
        }
        if !(stiffness > 0.0 && damping >= 0.0) {
            return wrong("its stiffness must be positive, its damping not negative");
        }
        Ok(())
    }
}
