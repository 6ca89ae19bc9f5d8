//! Forces with their torques.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A force and a torque about the origin of a frame.
///
/// ```
/// use glam::DVec3;
/// use trocar_core::Wrench;
///
/// let push = Wrench::at(DVec3::Y, 0.1 * DVec3::X);
/// assert_eq!(push.torque, 0.1 * DVec3::Z);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wrench {
    /// Force (N).
    pub force: DVec3,
    /// Torque about the frame's origin (N m).
    pub torque: DVec3,
}

impl Wrench {
    /// The wrench of a `force` (N) that acts at `point` (m).
    pub fn at(force: DVec3, point: DVec3) -> Self {
        Self { force, torque: point.cross(force) }
    }

    /// Whether all six numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.force.is_finite() && self.torque.is_finite()
    }

    /// Force (N), then torque (N m).
    pub fn to_array(self) -> [f64; 6] {
        let (f, t) = (self.force, self.torque);
        [f.x, f.y, f.z, t.x, t.y, t.z]
    }
}

impl std::ops::Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

impl std::ops::AddAssign for Wrench {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl std::ops::Sub for Wrench {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { force: self.force - other.force, torque: self.torque - other.torque }
    }
}
