//! Where colliders are in a substep, in the frame of a body.

use crate::frame::Frame;
use crate::grasp::travel;
use crate::{Body, Collider, Grasp};
use glam::{DVec3, Vec3A};
use trocar_core::Pose;

/// What slides by less than this in a substep (m) sticks.
const LEAST_SLIP: f32 = 1e-7;

/// A contact that slides by more than this share of a tool's size in a substep has no predicted
/// plane.
const MAX_SLIP_SHARE: f32 = 0.3;

/// Cosine of the greatest angle between the predicted plane and the present one. Beyond it, the
/// predicted point is on another side of the tool.
const LEAST_TURN_COSINE: f64 = 0.9;

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

    /// Normal and point of the plane at the substep's end, in the frame of `body`, of a place that
    /// is at `p` in the tool's frame and is expected `there` ([`Self::beside`]).
    ///
    /// The plane of the present point is wrong for what slides: on a tool of 3 mm that is dragged
    /// at 6 mm/s it is off by one degree, and a sixtieth of the normal force acts along the
    /// surface.
    pub fn plane(&self, collider: &Collider, body: &Body, p: DVec3, there: Vec3A) -> (Vec3A, Vec3A) {
        let here = collider.shape.nearest(p);
        let ahead = self.from.transform(body.origin + there.as_dvec3());
        let nearest = collider.shape.nearest(ahead);
        let (place, nearest) =
            if nearest.normal.dot(here.normal) > LEAST_TURN_COSINE { (ahead, nearest) } else { (p, here) };
        let height = nearest.distance - collider.rest_offset;
        let point = self.to.transform(place - height * nearest.normal) - body.origin;
        ((self.to.rotation * nearest.normal).as_vec3a(), point.as_vec3a())
    }

    /// Where a vertex at `x` that goes by `way` (m) will be beside the collider at the substep's
    /// end, moved back with the tool to the beginning; in the frame of `body`. None where it
    /// sticks, or goes too far to be trusted.
    pub fn beside(&self, body: &Body, x: Vec3A, way: Vec3A) -> Option<Vec3A> {
        let end = self.to.inverse().transform(body.origin + (x + way).as_dvec3());
        let ahead = (self.from.inverse().transform(end) - body.origin).as_vec3a();
        let slip = (ahead - x).length_squared();
        let most = MAX_SLIP_SHARE * self.radius;
        (slip > LEAST_SLIP * LEAST_SLIP && slip < most * most).then_some(ahead)
    }

    /// Points of the collider at the substep's beginning, in the frame of `body` (m).
    pub fn at_beginning(&self, body: &Body, points: [DVec3; 2]) -> [Vec3A; 2] {
        let pose = self.from.inverse();
        points.map(|p| (pose.transform(p) - body.origin).as_vec3a())
    }
}
