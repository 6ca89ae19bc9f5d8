//! The live-pose grasp: a tool carries nodes rigidly from where they were when it closed.
//!
//! Paper, equation (4): o_i = R(t_a)' (x_i(t_a) - p(t_a)), then x_i = R o_i + p, v_i = 0 until the
//! jaws open. Stored are x_i(t_a) and the tool's pose at t_a. The position is evaluated as the same
//! map in a form that is exact to the bit at activation (no snap):
//! `x_i(t_a) + (R R(t_a)' - I)(x_i(t_a) - p(t_a)) + (p - p(t_a))`.

mod hash;
mod tool_motion;

use glam::{DVec3, Vec3A};
pub use tool_motion::ToolMotion;
pub(crate) use tool_motion::travel;
use trocar_core::Pose;

/// Compliance of a grasp: its nodes are on springs, held in the jaws by Coulomb friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// Stiffness of a node's spring (N/m).
    pub stiffness: f64,
    /// Unit vector across the closing plane, in the tool's frame. Along it the blades hold on both
    /// sides and nothing slips.
    pub closing: DVec3,
    /// Force with which the jaws close (N). It may be changed while they hold.
    pub jaw_force: f64,
    /// Coulomb friction coefficient of a blade. There are two blades, so tissue slips at twice
    /// `friction` times `jaw_force`.
    pub friction: f64,
    /// Force at the end of a frame, in any direction, at which the tissue tears out of the jaws
    /// (N).
    pub tear_force: f64,
    /// The tools whose colliders are the blades: their friction on this body is that of the grasp
    /// and is not counted twice.
    pub blades: Option<[usize; 2]>,
}

/// A set of nodes carried by a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The tool that carries them: its index in the motions of a step.
    pub tool: usize,
    /// The body.
    pub body: usize,
    /// Its nodes.
    pub nodes: Vec<u32>,
    /// Where each node was at activation (m).
    pub(crate) captured: Vec<DVec3>,
    /// Where the tool was at activation.
    pub(crate) captured_at: Pose,
    /// None: the nodes follow the tool exactly.
    pub compliance: Option<Compliance>,
    /// How far each node has slipped through the jaws, in the tool's frame (m).
    pub(crate) slid: Vec<Vec3A>,
    /// Whether more than half of the nodes slip.
    pub(crate) slips: bool,
    /// Whether the tissue tore out of it: it is empty then.
    pub(crate) torn: bool,
}

impl Grasp {
    /// The same grasp on springs.
    pub fn compliant(self, compliance: Compliance) -> Self {
        Self { compliance: Some(compliance), ..self }
    }

    /// Whether the tissue tore out of it: it is empty then.
    pub fn is_torn(&self) -> bool {
        self.torn
    }

    /// Whether the tissue slips through the jaws.
    pub fn slips(&self) -> bool {
        self.slips
    }

    /// Mean slip of its nodes through the jaws since activation, in the tool's frame (m).
    pub fn slip(&self) -> DVec3 {
        let sum: DVec3 = self.slid.iter().map(|s| s.as_dvec3()).sum();
        sum / self.nodes.len().max(1) as f64
    }

    /// Whether its nodes are on springs and it is not torn.
    pub(crate) fn is_compliant(&self) -> bool {
        self.compliance.is_some() && !self.torn
    }

    /// [`Grasp::prescribed`] of one node, by its index in `nodes`.
    pub(crate) fn prescribed_node(&self, tool: &Pose, k: usize) -> (u32, DVec3) {
        let from = &self.captured_at;
        let arm = self.captured[k] - from.translation;
        let turned = tool.rotation != from.rotation;
        let swing = if turned { tool.rotation * from.rotation.inverse() * arm - arm } else { DVec3::ZERO };
        (self.nodes[k], self.captured[k] + (swing + (tool.translation - from.translation)))
    }

    /// Where each held node is to be when the tool is at `tool`: node and world position (m).
    pub fn prescribed(&self, tool: &Pose) -> impl Iterator<Item = (u32, DVec3)> {
        let tool = *tool;
        (0..self.nodes.len()).map(move |k| self.prescribed_node(&tool, k))
    }
}
