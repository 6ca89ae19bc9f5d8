//! Forces from outside on single nodes: what pushes or pulls tissue that is no tool, and what contact did in another run.

use crate::Model;
use crate::integrator::Frame;
use glam::DVec3;

/// A force on a node throughout a frame. What pins or tools hold rigidly does not feel it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// The body's index in the model.
    pub body: usize,
    /// The node's in the body.
    pub node: usize,
    /// [N], in the world's frame.
    pub force: DVec3,
}

impl Load {
    /// Whether `model` has such a node, and the force is one.
    pub(crate) fn fits(&self, model: &Model) -> bool {
        self.force.is_finite() && model.bodies.get(self.body).is_some_and(|body| self.node < body.len())
    }
}

impl Frame<'_> {
    /// Calls `act` for every load on the body, with the vertex and the force [N].
    #[inline(always)]
    pub fn for_loads(&self, body: &crate::Body, mut act: impl FnMut(usize, DVec3)) {
        for load in self.loads.iter().filter(|load| load.body == self.index) {
            act(body.internal[load.node] as usize, load.force);
        }
    }
}
