//! What every solver is: it advances one body by one frame.

use crate::state::BodyState;
use crate::{Body, Grasp, StepReport, ToolMotion};
use glam::{DVec3, Vec3A};

/// A solver with its scratch memory for one body.
pub(crate) trait Integrator: Send {
    /// Advances `state` by `frame`; writes what happened on the way into `report`. It allocates nothing.
    fn advance(&mut self, frame: &Frame<'_>, body: &Body, state: &mut BodyState, report: &mut StepReport);
}

/// What happens to a body from outside during one frame.
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
}

impl Frame<'_> {
    /// The body's grasps.
    pub fn grasps(&self) -> impl Iterator<Item = &Grasp> {
        self.grasps.iter().filter(|g| g.body == self.index)
    }

    /// Calls `place(vertex, position)` for every vertex that a tool carries, where it is to be when `share` of the frame is over, in the body's frame [m]. Vertices held
    /// by a tool of which no motion is given stay where they are and are left out.
    pub fn for_held(&self, body: &Body, share: f64, mut place: impl FnMut(usize, Vec3A)) {
        for grasp in self.grasps() {
            if let Some(motion) = self.tools.get(grasp.tool) {
                for (node, x) in grasp.prescribed(&motion.at(share)) {
                    place(body.internal[node as usize] as usize, (x - body.origin).as_vec3a());
                }
            }
        }
    }
}
