//! Where colliders are in a substep, as a body sees them.

use super::contacts::Contacts;
use crate::integrator::Frame;
use crate::{Body, Collider};
use glam::Vec3A;
use trocar_core::Pose;

impl Contacts {
    pub(super) fn place_tools(&mut self, frame: &Frame<'_>, body: &Body, from: f64, to: f64) {
        self.placed.clear();
        let grasps = || frame.grasps.iter().filter(|g| g.body == frame.index && g.hangs());
        let placed = |collider: &Collider| {
            let motion = frame.tools.get(collider.tool)?;
            let blades = |g: &crate::Grasp| g.compliance.and_then(|c| c.blades);
            let held = grasps().filter_map(blades).any(|blades| blades.contains(&collider.tool));
            Some(Placed::new(collider, motion.at(from), motion.at(to), body, held))
        };
        self.placed.extend(frame.colliders.iter().map(placed));
    }
}

/// A collider in a substep.
pub(super) struct Placed {
    /// From the world into its frame at the beginning, and out of it at the end.
    pub from: Pose,
    pub to: Pose,
    /// A ball round it at the beginning, in the body's frame [m].
    pub centre: Vec3A,
    pub radius: f32,
    /// How far from it a vertex may be that it touches without moving itself [m].
    pub reach: f32,
    /// Whether it is a blade of jaws that hold the body compliantly.
    pub grips: bool,
}

impl Placed {
    pub fn new(collider: &Collider, from: Pose, to: Pose, body: &Body, grips: bool) -> Self {
        let (centre, radius) = collider.shape.bounds(0.0);
        // How far a half-space turns is not bounded.
        let arm = if radius.is_finite() { centre.length() + radius } else { 0.0 };
        Self {
            from: from.inverse(),
            to,
            centre: (from.transform(centre) - body.origin).as_vec3a(),
            radius: radius as f32,
            reach: (collider.rest_offset + crate::grasp::way(&from, &to, arm)) as f32,
            grips,
        }
    }
}
