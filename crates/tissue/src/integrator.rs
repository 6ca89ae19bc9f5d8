//! What every solver is: it advances bodies by one frame, those that may touch each other together.

use crate::contact::{Contacts, Pairs, Reaction};
use crate::report::Measured;
use crate::state::BodyState;
use crate::untangle::Untangler;
use crate::{Body, Collider, Grasp, Load, StepReport, ToolMotion};
use glam::{DVec3, Vec3A};
use rayon::prelude::*;

/// A solver with its scratch memory for one body.
pub(crate) trait Solver: Send + Sync + Sized {
    /// Whether bodies can touch each other.
    const COUPLES: bool;

    /// Advances the bodies of an island, which may touch each other and nothing else, by `frame`; writes what happened on the way into their reports. The first has what may touch. It
    /// allocates nothing, but for longer lists of what touches.
    fn advance(island: &mut [Worker<Self>], frame: &Frame<'_>);

    /// What the body touched in the last frame; None for a solver that knows no tools.
    fn contacts(&self) -> Option<&Contacts> {
        None
    }
}

/// A body with its solver, on its way through a frame.
pub(crate) struct Worker<S> {
    /// The body's place in the model.
    pub index: usize,
    /// The body that the solver was made for.
    pub body: Body,
    pub solver: S,
    pub state: BodyState,
    pub report: StepReport,
    /// Where the bodies of the island may touch, of its first.
    pub pairs: Pairs,
    /// The island.
    pub island: usize,
    pub reaction: Reaction,
    pub untangler: Untangler,
    pub measured: Measured,
    /// The state at the frame's beginning.
    pub before: BodyState,
}

/// What happens to a body from outside during one frame.
#[derive(Clone, Copy)]
pub(crate) struct Frame<'a> {
    /// Length [s].
    pub dt: f64,
    /// Gravitational acceleration [m/s2].
    pub gravity: DVec3,
    /// The body's index in the model.
    pub index: usize,
    /// All grasps in force.
    pub grasps: &'a [Grasp],
    /// Motions of the tools, by tool.
    pub tools: &'a [ToolMotion],
    /// Forces on nodes.
    pub loads: &'a [Load],
    /// What touches bodies.
    pub colliders: &'a [Collider],
    /// Whether the calling thread is to do all the work.
    pub alone: bool,
}

/// Does the same with every body of an island, in parallel.
pub(crate) fn for_each<S: Solver>(
    island: &mut [Worker<S>],
    frame: &Frame<'_>,
    work: impl Fn(&mut Worker<S>) + Send + Sync,
) {
    if frame.alone || island.len() < 2 {
        island.iter_mut().for_each(work);
    } else {
        island.par_iter_mut().with_max_len(1).for_each(work);
    }
}

impl Frame<'_> {
    /// The same for another body.
    pub fn of(&self, index: usize) -> Self {
        Self { index, ..*self }
    }

    /// How far colliders that may come to the body in the frame may push it [m]. `meets` asks for boxes round parts of the body's surface, in
    /// its frame, whether a collider reaches them, by their middle and half their diagonal.
    pub fn pushes(&self, body: &Body, meets: impl Fn(&dyn Fn(Vec3A, f32) -> bool) -> bool) -> f64 {
        let way = |collider: &Collider| {
            let motion = self.tools.get(collider.tool)?;
            let back = motion.from.inverse();
            let (centre, radius) = collider.shape.bounds(collider.rest_offset);
            let place = |middle: Vec3A| back.transform(body.origin + middle.as_dvec3());
            // How far a half-space turns is not bounded: what matters of it is near the body.
            let arm = if radius.is_finite() { centre.length() + radius } else { place(Vec3A::ZERO).length() + 1.0 };
            let way = crate::grasp::way(&motion.from, &motion.to, arm);
            let reaches = |middle: Vec3A, half: f32| {
                collider.shape.nearest(place(middle)).distance - collider.rest_offset <= way + f64::from(half)
            };
            (way > 0.0 && meets(&reaches)).then_some(way)
        };
        self.colliders.iter().filter_map(way).fold(0.0, f64::max)
    }

    /// The body's grasps that hold something.
    pub fn grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.grasps.iter().filter(|g| g.body == self.index && !g.torn)
    }

    /// Those whose nodes follow the tool exactly, or stay where they are because it has no motion.
    pub fn rigid_grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.grasps().filter(|g| g.compliance.is_none() || g.tool >= self.tools.len())
    }

    /// Calls `place(vertex, position)` for every vertex that a tool carries rigidly, where it is to be when `share` of the frame is over, in the body's frame [m]. Vertices held
    /// by a tool of which no motion is given stay where they are and are left out.
    pub fn for_held(&self, body: &Body, share: f64, mut place: impl FnMut(usize, Vec3A)) {
        for grasp in self.rigid_grasps() {
            if let Some(motion) = self.tools.get(grasp.tool) {
                for (node, x) in grasp.prescribed(&motion.at(share)) {
                    place(body.internal[node as usize] as usize, (x - body.origin).as_vec3a());
                }
            }
        }
    }
}
