//! Where colliders are in a substep, in the frame of a body.

use crate::frame::Frame;
use crate::grasp::travel;
use crate::{Body, Collider, Grasp};
use glam::{DVec3, Vec3A};
use trocar_core::Pose;

/// Places the colliders of a substep between two shares of the frame; None: the tool has no motion.
pub(super) fn place(frame: &Frame<'_>, body: &Body, from: f64, to: f64, placed: &mut Vec<Option<Placed>>) {
    placed.clear();
    let grasps = || frame.grasps.iter().filter(|g| g.body == frame.index && g.is_compliant());
    let place = |collider: &Collider| {
        let motion = frame.tools.get(collider.tool)?;
        let blades = |g: &Grasp| g.compliance.and_then(|c| c.blades);
        let held = grasps().filter_map(blades).any(|blades| blades.contains(&collider.tool));
        Some(Placed::new(collider, motion.at(from), motion.at(to), body, held))
    };
    placed.extend(frame.colliders.iter().map(place));
}

/// A collider in a substep.
pub(super) struct Placed {
    /// From the world into its frame at the beginning, and out of it at the end.
    pub from: Pose,
    pub to: Pose,
    /// A ball around it at the beginning, in the body's frame (m).
    pub centre: Vec3A,
    pub radius: f32,
    /// Distance from which a vertex that does not move may touch it (m).
    pub reach: f32,
    /// Whether it is a blade of jaws that hold the body compliantly.
    pub grips: bool,
}

impl Placed {
    pub fn new(collider: &Collider, from: Pose, to: Pose, body: &Body, grips: bool) -> Self {
        let (centre, radius) = collider.shape.bounds(0.0);
        // The travel of a turning half-space has no bound.
        let arm = if radius.is_finite() { centre.length() + radius } else { 0.0 };
        Self {
            from: from.inverse(),
            to,
            centre: (from.transform(centre) - body.origin).as_vec3a(),
            radius: radius as f32,
            reach: (collider.rest_offset + travel(&from, &to, arm)) as f32,
            grips,
        }
    }

    /// Points of the collider at the substep's beginning, in the frame of `body` (m).
    pub fn at_beginning(&self, body: &Body, points: [DVec3; 2]) -> [Vec3A; 2] {
        let pose = self.from.inverse();
        points.map(|p| (pose.transform(p) - body.origin).as_vec3a())
    }
}
