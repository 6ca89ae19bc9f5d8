//! Transforms between frames: `geometry_msgs`, `tf2_msgs` and foxglove's.

use super::error::Parsed;
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// The pose of a child frame in a parent frame: points of the child frame, rotated and then
/// translated, are points of the parent frame.
///
/// librealsense uses a bare `geometry_msgs/Transform` differently; see [`super::realsense`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transform {
    /// Time (ns since the epoch); 0 when the message has none.
    pub stamp: u64,
    /// Name of the parent frame; empty when the message has none.
    pub parent: String,
    /// Name of the child frame; empty when the message has none.
    pub child: String,
    /// Translation (m).
    pub translation: [f64; 3],
    /// Rotation, a unit quaternion x y z w.
    pub rotation: [f64; 4],
}

impl Transform {
    /// Rotation and translation, with the quaternion normalised.
    pub fn pose(&self) -> Pose {
        Pose {
            rotation: DQuat::from_array(self.rotation).normalize(),
            translation: DVec3::from_array(self.translation),
        }
    }

    /// Refuses numbers that are not finite and quaternions that are not unit.
    pub(crate) fn check(self) -> Parsed<Self> {
        let length = self.rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !(length - 1.0).abs().is_finite() || (length - 1.0).abs() > 0.01 {
            return Err(format!("rotation is {:?}; it must be a unit quaternion", self.rotation));
        }
        if self.translation.iter().any(|t| !t.is_finite()) {
            return Err(format!("translation is {:?}; it must be finite (m)", self.translation));
        }
        Ok(self)
    }
}
