//! The live-pose grasp: nodes carried rigidly by a tool from where they were when it closed.
//!
//! Paper, equation (4): o_i = R(t_a)' (x_i(t_a) - p(t_a)), then x_i = R o_i + p, v_i = 0 until the jaws open. Stored as
//! x_i(t_a) and the tool pose at t_a and evaluated as x_i(t_a) + (R R(t_a)' - I)(x_i(t_a) - p(t_a)) + (p - p(t_a)), the
//! same map, which is exact (snap 0 to the bit) at activation.

use crate::{Model, State};
use trocar_geometry::Pose;

/// Pose of a tool at the beginning and the end of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMotion {
    /// Pose at the frame's beginning.
    pub from: Pose,
    /// Pose at the frame's end.
    pub to: Pose,
}

/// A set of nodes carried by a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The body.
    pub body: usize,
    /// Its nodes.
    pub nodes: Vec<u32>,
}

impl Grasp {
    /// Captures `nodes` of `body` where they are now, with the tool at `tool`. Pinned nodes are left out.
    pub fn capture(model: &Model, state: &State, body: usize, nodes: &[u32], tool: &Pose) -> Self {
        let _ = (model, state, body, nodes, tool);
        todo!()
    }
}
