//! The live-pose grasp: nodes carried rigidly by a tool from where they were when it closed.
//!
//! Paper, equation (4): o_i = R(t_a)' (x_i(t_a) - p(t_a)), then x_i = R o_i + p, v_i = 0 until the jaws open. Stored as
//! x_i(t_a) and the tool pose at t_a and evaluated as x_i(t_a) + (R R(t_a)' - I)(x_i(t_a) - p(t_a)) + (p - p(t_a)), the
//! same map, which is exact (snap 0 to the bit) at activation.

use crate::{Model, State};
use glam::DVec3;
use trocar_geometry::Pose;

/// Pose of a tool at the beginning and the end of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMotion {
    /// Pose at the frame's beginning.
    pub from: Pose,
    /// Pose at the frame's end.
    pub to: Pose,
}

impl ToolMotion {
    /// The pose when `share` (0..=1) of the frame is over.
    pub fn at(&self, share: f64) -> Pose {
        if share >= 1.0 {
            return self.to;
        }
        Pose {
            rotation: self.from.rotation.slerp(self.to.rotation, share),
            translation: self.from.translation.lerp(self.to.translation, share),
        }
    }
}

/// How a grasp gives way: its nodes hang on springs, held in the jaws by Coulomb's friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compliance {
    /// Stiffness of a node's spring [N/m].
    pub stiffness: f64,
    /// Unit vector across the closing plane, in the tool's frame. Along it the blades hold on both sides and nothing slips.
    pub closing: DVec3,
    /// Force with which the jaws close [N]. It may be changed while they hold.
    pub jaw_force: f64,
    /// Coulomb friction coefficient of a blade. There are two, so that tissue slips at twice `friction` times `jaw_force`.
    pub friction: f64,
    /// Pull at which the tissue tears out of the jaws [N].
    pub tear_force: f64,
}

/// A set of nodes carried by a tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The tool that carries them: its place among the motions of a step.
    pub tool: usize,
    /// The body.
    pub body: usize,
    /// Its nodes.
    pub nodes: Vec<u32>,
    /// Where each node was at activation [m].
    pub(crate) captured: Vec<DVec3>,
    /// Where the tool was.
    pub(crate) captured_at: Pose,
    /// None: the nodes follow the tool exactly.
    pub compliance: Option<Compliance>,
    /// The tissue tore out of it; it holds nothing.
    pub torn: bool,
}

impl Grasp {
    /// Captures `nodes` of `body` where they are now, with tool number `tool` at `pose`. Pinned nodes are left out.
    pub fn capture(model: &Model, state: &State, body: usize, nodes: &[u32], tool: usize, pose: &Pose) -> Self {
        let free = |i: &u32| !model.bodies[body].pinned()[*i as usize];
        let nodes: Vec<u32> = nodes.iter().copied().filter(free).collect();
        let captured = nodes.iter().map(|i| state.position(model, body, *i as usize)).collect();
        Self { tool, body, nodes, captured, captured_at: *pose, compliance: None, torn: false }
    }

    /// Holds `nodes` of `body` such that, with tool number `tool` at `pose`, each is to be at its place of `positions` [m, world], wherever it is now. Pinned nodes are left out.
    pub fn prescribe(model: &Model, body: usize, nodes: &[u32], positions: &[DVec3], tool: usize, pose: &Pose) -> Self {
        let free = |(i, _): &(&u32, &DVec3)| !model.bodies[body].pinned()[**i as usize];
        let (nodes, captured) = nodes.iter().zip(positions).filter(free).map(|(i, x)| (*i, *x)).unzip();
        Self { tool, body, nodes, captured, captured_at: *pose, compliance: None, torn: false }
    }

    /// The same grasp, giving way.
    pub fn compliant(self, compliance: Compliance) -> Self {
        Self { compliance: Some(compliance), ..self }
    }

    /// Where each held node is to be when the tool is at `tool`: (node, world position [m]).
    pub fn prescribed(&self, tool: &Pose) -> impl Iterator<Item = (u32, DVec3)> {
        let from = &self.captured_at;
        let turn = tool.rotation * from.rotation.inverse();
        let shift = tool.translation - from.translation;
        let turned = tool.rotation != from.rotation;
        let (nodes, captured) = (self.nodes.iter(), self.captured.iter());
        nodes.zip(captured).map(move |(i, x)| {
            let arm = x - from.translation;
            let swing = if turned { turn * arm - arm } else { DVec3::ZERO };
            (*i, x + (swing + shift))
        })
    }
}
