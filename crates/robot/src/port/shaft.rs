//! The shaft of an instrument and its twist.

use crate::instrument::Instrument;
use glam::DVec3;
use trocar_core::Pose;

/// The velocity of a rigid body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Velocity of the body's reference point (m/s).
    pub linear: DVec3,
    /// Angular velocity (rad/s).
    pub angular: DVec3,
}

impl Twist {
    /// Velocity (m/s) of the body at `point` (m), for a twist at `reference` (m).
    pub fn at(&self, reference: DVec3, point: DVec3) -> DVec3 {
        self.linear + self.angular.cross(point - reference)
    }
}

/// The shaft of an instrument: a cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Its base at the motor housing (m), in the cell. The reference point of its [`Twist`].
    pub base: DVec3,
    /// Unit vector from base to end, in the cell.
    pub direction: DVec3,
    /// Radius (m).
    pub radius: f64,
    /// Length (m).
    pub length: f64,
}

impl Shaft {
    /// The shaft of an instrument whose flange is at `flange` in the cell.
    pub fn of(instrument: &Instrument, flange: &Pose) -> Self {
        let pose = crate::instrument::compose(flange, &instrument.mount);
        Self {
            base: pose.translation,
            direction: pose.rotation * DVec3::Z,
            radius: instrument.shaft_radius,
            length: instrument.shaft_length,
        }
    }
}
