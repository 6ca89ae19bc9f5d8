//! Tools that move together, as a body sees them.

use crate::state::Source;
use crate::{Collider, Grasp};
use glam::DVec3;

/// Tools that move together as one rigid body.
#[derive(Clone, Copy)]
pub(crate) struct ToolGroup<'a> {
    /// Length of a frame (s).
    pub dt: f64,
    /// The tools.
    pub tools: &'a [usize],
    /// The point about which they turn (m).
    pub about: DVec3,
    /// All grasps.
    pub grasps: &'a [Grasp],
    /// All colliders.
    pub colliders: &'a [Collider],
}

impl ToolGroup<'_> {
    /// Whether what a vertex touches moves with the tools.
    pub fn moves(&self, source: Source) -> bool {
        let tool = match source {
            Source::Collider(c) => self.colliders.get(c as usize).map(|collider| collider.tool),
            Source::Grasp(g, _) => self.grasps.get(g as usize).map(|grasp| grasp.tool),
            Source::Support(_) | Source::Body(_) | Source::Tether(_) => None,
        };
        tool.is_some_and(|tool| self.tools.contains(&tool))
    }
}
