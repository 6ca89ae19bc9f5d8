//! Solid obstacles that an instrument presses on in a step: other instruments, the bed, tissue that
//! does not move.

use super::controlled_arm::Manipulator;
use super::touch::Touches;
use crate::chain::{Coupling, CouplingLaw, Frames};
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
    fn check(&self, k: usize) -> Result<()> {
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

impl Manipulator {
    /// Adds `obstacles` to the couplings of a step of `dt` (s).
    pub(super) fn meet(&self, obstacles: &[Obstacle], frames: &Frames, touches: &mut Touches, dt: f64) -> Result<()> {
        if obstacles.len() > MAX_OBSTACLES {
            let reason = format!("there are {}; the maximum is {MAX_OBSTACLES}", obstacles.len());
            return Err(Error::invalid("obstacles", reason));
        }
        for (k, o) in obstacles.iter().enumerate() {
            o.check(k)?;
            // The obstacle's own motion in the step shortens the gap from the beginning; its speed
            // is taken off the damper's.
            let displacement = o.gap - o.speed * (dt + o.damping / o.stiffness);
            let row = frames.jacobian(self.arm.dof(), o.point).row(o.normal);
            let coupling = Coupling::new(row, displacement, o.stiffness, CouplingLaw::Push);
            touches.add(Coupling { damping: o.damping, ..coupling }, (o.point, o.normal));
        }
        Ok(())
    }

    /// The mass (kg) that a force at `point` (m) of the instrument along the unit vector
    /// `direction` accelerates, in the cell: 1 / (J M^-1 J^T) with the arm's mass matrix M and the
    /// row J of the point's Jacobian (Khatib 1987). Infinite if the arm cannot move that way.
    pub fn reflected_mass(&self, point: DVec3, direction: DVec3) -> f64 {
        let q = &self.state.arm.q;
        let row = self.arm.frames(q).jacobian(self.arm.dof(), point).row(direction);
        let given = self.arm.mass_matrix(q).factor().map_or(0.0, |factor| row.dot(&factor.solve(&row)));
        if given > 0.0 { given.recip() } else { f64::INFINITY }
    }
}
