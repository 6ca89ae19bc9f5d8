//! Rigid poses.

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A rigid pose: maps points of its own frame to the parent frame,
/// x_parent = rotation * x + translation.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use trocar_core::Pose;
///
/// let quarter_turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
/// let pose = Pose { rotation: quarter_turn, translation: DVec3::X };
/// let p = pose.transform(DVec3::X);
/// assert!(p.distance(DVec3::new(1.0, 1.0, 0.0)) < 1e-15);
/// assert!(pose.inverse().transform(p).distance(DVec3::X) < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Rotation from the own frame to the parent frame.
    pub rotation: DQuat,
    /// Origin of the own frame in the parent frame (m).
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

    /// Maps a point (m) of the own frame to the parent frame.
    pub fn transform(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.translation
    }

    /// The inverse pose.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Interpolates to the pose `to`: spherically in rotation, linearly in translation. `t` = 0 is
    /// this pose, `t` = 1 is `to`, up to rounding.
    pub fn interpolate(&self, to: &Self, t: f64) -> Self {
        Self { rotation: self.rotation.slerp(to.rotation, t), translation: self.translation.lerp(to.translation, t) }
    }

    /// The pose of an OpenCV camera (x right, y down, z forward) at `eye` that looks at `target`,
    /// with `up` towards the top of the image. Where `up` is parallel to the view, any other
    /// direction takes its place.
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
    fn look_at_places_the_target_ahead_and_up_at_the_top() {
        let pose = Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 5.0, 3.0), DVec3::Z);
        let inverse = pose.inverse();
        assert!((inverse.transform(DVec3::new(1.0, 5.0, 3.0)) - 3.0 * DVec3::Z).length() < 1e-12);
        assert!(inverse.transform(DVec3::new(1.0, 5.0, 4.0)).y < 0.0, "up is towards negative image y");
        assert!(inverse.transform(DVec3::new(2.0, 5.0, 3.0)).x > 0.0, "facing +y with z up, +x is to the right");
    }

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose = Pose { rotation: DQuat::from_rotation_y(0.7), translation: DVec3::new(0.1, -0.2, 0.3) };
        let p = DVec3::new(3.0, 2.0, -1.0);
        assert!((pose.inverse().transform(pose.transform(p)) - p).length() < 1e-15);
    }
}
