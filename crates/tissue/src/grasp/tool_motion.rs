//! Where a tool is during a frame.

use crate::Body;
use glam::DVec3;
use trocar_core::Pose;

/// Pose of a tool at the beginning and the end of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMotion {
    /// Pose at the frame's beginning.
    pub from: Pose,
    /// Pose at the frame's end.
    pub to: Pose,
}

impl ToolMotion {
    /// The pose when `share` (0..=1) of the frame is over.
    pub fn at(&self, share: f64) -> Pose {
        if share >= 1.0 {
            return self.to;
        }
        Pose {
            rotation: self.from.rotation.slerp(self.to.rotation, share),
            translation: self.from.translation.lerp(self.to.translation, share),
        }
    }

    /// Upper bound of how far the tool carries any part of a body (m).
    pub(crate) fn travel(&self, body: &Body) -> f64 {
        let size = |p: &DVec3| (*p - self.from.translation).length_squared();
        let turns = self.from.rotation != self.to.rotation;
        let arm = if turns { body.rest.vertices.iter().map(size).fold(0.0, f64::max).sqrt() } else { 0.0 };
        travel(&self.from, &self.to, arm)
    }
}

/// Upper bound of how far a point travels between two poses, `arm` (m) away from their origin.
pub(crate) fn travel(from: &Pose, to: &Pose, arm: f64) -> f64 {
    let turn = 2.0 * libm::asin((to.rotation * from.rotation.inverse()).xyz().length().min(1.0));
    (to.translation - from.translation).length() + turn * arm
}
