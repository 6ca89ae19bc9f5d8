//! Transforms between frames: `geometry_msgs`, `tf2_msgs` and foxglove's.

use super::error::Parsed;
use glam::{DQuat, DVec3};
use trocar_camera::Pose;

/// A frame's place in another: points of the child frame, rotated and then moved, are points of the
/// parent frame.
///
/// librealsense uses a bare `geometry_msgs/Transform` otherwise; see [`super::realsense`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transform {
    /// [ns since the epoch]; 0 when the message has none.
    pub stamp: u64,
    /// Name of the parent frame; empty when the message has none.
    pub parent: String,
    /// Name of the child frame; empty when the message has none.
    pub child: String,
    /// Translation [m].
    pub translation: [f64; 3],
    /// Rotation, a unit quaternion x y z w.
    pub rotation: [f64; 4],
}

impl Transform {
    /// The rotation and translation, the rotation made exactly unit.
    pub fn pose(&self) -> Pose {
        Pose {
            rotation: DQuat::from_array(self.rotation).normalize(),
            translation: DVec3::from_array(self.translation),
        }
    }

    /// Refuses numbers that are not finite and rotations that are none.
    pub(crate) fn check(self) -> Parsed<Self> {
        let length = self.rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !(length - 1.0).abs().is_finite() || (length - 1.0).abs() > 0.01 {
            return Err(format!("rotation is {:?}; expected a unit quaternion", self.rotation));
        }
        if self.translation.iter().any(|t| !t.is_finite()) {
            return Err(format!("translation is {:?}; expected finite metres", self.translation));
        }
        Ok(self)
    }
}
