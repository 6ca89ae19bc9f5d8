//! Forces from outside on single nodes: pushes and pulls that no tool makes, or contact forces of
//! another run.

use crate::Model;
use glam::DVec3;

/// A force on a node throughout a frame. Nodes that are pinned or held rigidly do not feel it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// The body's index in the model.
    pub body: usize,
    /// The node's index in the body.
    pub node: usize,
    /// The force in world axes (N).
    pub force: DVec3,
}

impl Load {
    /// Whether `model` has the node, and the force is finite.
    pub(crate) fn fits(&self, model: &Model) -> bool {
        self.force.is_finite() && model.bodies.get(self.body).is_some_and(|body| self.node < body.len())
    }
}
