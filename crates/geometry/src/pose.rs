//! Rigid poses.

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid pose: maps points of its own frame to the parent's, x_parent = rotation * x + translation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation from the own frame to the parent's.
    pub rotation: DQuat,
    /// Origin of the own frame in the parent's [m].
    pub translation: DVec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// No rotation, no translation.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Applies the pose to a point [m].
    pub fn transform(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    /// The pose that undoes this one.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// An OpenCV camera (x right, y down, z forward) at `eye` that looks at `target`, the image's top towards `up`. Where
    /// `up` runs along the view, another is chosen.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let z = (target - eye).normalize_or(DVec3::Z);
        let x = z.cross(up).try_normalize().unwrap_or_else(|| z.any_orthonormal_vector());
        let y = z.cross(x);
        Self { rotation: DQuat::from_mat3(&DMat3::from_cols(x, y, z)), translation: eye }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_the_target_ahead_and_up_up() {
        let pose = Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 5.0, 3.0), DVec3::Z);
        let inverse = pose.inverse();
        assert!((inverse.transform(DVec3::new(1.0, 5.0, 3.0)) - 3.0 * DVec3::Z).length() < 1e-12);
        assert!(inverse.transform(DVec3::new(1.0, 5.0, 4.0)).y < 0.0, "up is towards negative image y");
        assert!(inverse.transform(DVec3::new(2.0, 5.0, 3.0)).x > 0.0, "facing +y with z up, +x is to the right");
    }

    #[test]
    fn inverse_undoes() {
        let pose = Pose { rotation: DQuat::from_rotation_y(0.7), translation: DVec3::new(0.1, -0.2, 0.3) };
        let p = DVec3::new(3.0, 2.0, -1.0);
        assert!((pose.inverse().transform(pose.transform(p)) - p).length() < 1e-15);
    }
}
