//! Rigid poses.

use glam::{DQuat, DVec3};
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

    /// A camera at `eye` that looks at `target`, with image "up" near `up` (camera y points away from it).
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let _ = (eye, target, up);
        todo!()
    }
}
