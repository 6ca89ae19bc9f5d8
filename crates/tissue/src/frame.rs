//! The loads on a model during one frame, as its bodies see them.

use crate::grasp::travel;
use crate::{Body, Collider, Grasp, Hole, Load, ToolContact, ToolMotion};
use glam::{DVec3, Vec3A};

/// What acts on a body from outside during one frame.
#[derive(Clone, Copy)]
pub(crate) struct Frame<'a> {
    /// Length (s).
    pub dt: f64,
    /// Gravitational acceleration (m/s2).
    pub gravity: DVec3,
    /// The body's index in the model.
    pub index: usize,
    /// All grasps in force.
    pub grasps: &'a [Grasp],
    /// All holes through which tools pass.
    pub holes: &'a [Hole],
    /// Motions of the tools, by tool.
    pub tools: &'a [ToolMotion],
    /// Forces on nodes.
    pub loads: &'a [Load],
    /// Parts of tools that touch bodies.
    pub colliders: &'a [Collider],
    /// What touches these parts.
    pub tool_contact: ToolContact,
    /// Whether the calling thread does all the work.
    pub single_thread: bool,
}

impl Frame<'_> {
    /// The same for another body.
    pub fn of(&self, index: usize) -> Self {
        Self { index, ..*self }
    }

    /// The body's grasps that hold something.
    pub fn grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.grasps.iter().filter(|g| g.body == self.index && !g.torn)
    }

    /// The grasps whose nodes follow the tool exactly, or stay where they are because the tool has
    /// no motion.
    pub fn rigid_grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.grasps().filter(|g| g.compliance.is_none() || g.tool >= self.tools.len())
    }

    /// Calls `place(vertex, position)` for every vertex that a tool carries rigidly, with its
    /// target when `share` of the frame is over, in the body's frame (m). Vertices that are held by
    /// a tool without a motion stay where they are and are left out.
    pub fn for_held(&self, body: &Body, share: f64, mut place: impl FnMut(usize, Vec3A)) {
        for grasp in self.rigid_grasps() {
            if let Some(motion) = self.tools.get(grasp.tool) {
                for (node, x) in grasp.prescribed(&motion.at(share)) {
                    place(body.internal[node as usize] as usize, (x - body.origin).as_vec3a());
                }
            }
        }
    }

    /// Calls `act(vertex, force)` for every load on the body (N).
    #[inline(always)]
    pub fn for_loads(&self, body: &Body, mut act: impl FnMut(usize, DVec3)) {
        for load in self.loads.iter().filter(|load| load.body == self.index) {
            act(body.internal[load.node] as usize, load.force);
        }
    }

    /// Upper bound of how far tools carry held nodes of the body (m); of rigid grasps only if
    /// `rigid`.
    pub fn carried(&self, body: &Body, rigid: bool) -> f64 {
        let travel = |grasp: &Grasp| self.tools.get(grasp.tool).map(|tool| tool.travel(body));
        let counts = |grasp: &&Grasp| !rigid || grasp.compliance.is_none() || grasp.tool >= self.tools.len();
        self.grasps().filter(counts).filter_map(travel).fold(0.0, f64::max)
    }

    /// Upper bound of how far colliders that may reach the body in the frame push it (m).
    ///
    /// `meets` calls its argument for boxes around parts of the body's surface, each by its middle
    /// in the body's frame and half its diagonal, and returns whether a collider reaches one.
    pub fn pushes(&self, body: &Body, meets: impl Fn(&dyn Fn(Vec3A, f32) -> bool) -> bool) -> f64 {
        let push = |collider: &Collider| {
            let motion = self.tools.get(collider.tool)?;
            let back = motion.from.inverse();
            let (centre, radius) = collider.shape.bounds(collider.rest_offset);
            let place = |middle: Vec3A| back.transform(body.origin + middle.as_dvec3());
            // The travel of a turning half-space has no bound; only its part near the body matters.
            let arm = if radius.is_finite() { centre.length() + radius } else { place(Vec3A::ZERO).length() + 1.0 };
            let way = travel(&motion.from, &motion.to, arm);
            let reaches = |middle: Vec3A, half: f32| {
                collider.shape.nearest(place(middle)).distance - collider.rest_offset <= way + f64::from(half)
            };
            (way > 0.0 && meets(&reaches)).then_some(way)
        };
        self.colliders.iter().filter_map(push).fold(0.0, f64::max)
    }
}
