//! The live-pose grasp: nodes carried rigidly by a tool from where they were when it closed.
//!
//! Paper, equation (4): o_i = R(t_a)' (x_i(t_a) - p(t_a)), then x_i = R o_i + p, v_i = 0 until the jaws open. Stored as
//! x_i(t_a) and the tool pose at t_a and evaluated as x_i(t_a) + (R R(t_a)' - I)(x_i(t_a) - p(t_a)) + (p - p(t_a)), the
//! same map, which is exact (snap 0 to the bit) at activation.

use crate::contact::Hanging;
use crate::{Body, Event, Model, State};
use glam::{DVec3, Vec3A};
use trocar_core::Pose;

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

    /// How far the tool carries any part of a body at most [m].
    pub(crate) fn travel(&self, body: &Body) -> f64 {
        let size = |p: &DVec3| (*p - self.from.translation).length_squared();
        let turns = self.from.rotation != self.to.rotation;
        let arm = if turns { body.rest.vertices.iter().map(size).fold(0.0, f64::max).sqrt() } else { 0.0 };
        way(&self.from, &self.to, arm)
    }
}

/// How far a point goes at most between two poses that is `arm` [m] from their origin.
pub(crate) fn way(from: &Pose, to: &Pose, arm: f64) -> f64 {
    let turn = 2.0 * (to.rotation * from.rotation.inverse()).xyz().length().min(1.0).asin();
    (to.translation - from.translation).length() + turn * arm
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
    /// Force at the end of a frame, along any direction, at which the tissue tears out of the jaws [N].
    pub tear_force: f64,
    /// The tools whose colliders are the blades: their friction on this body is the grasp's, and not counted again.
    pub blades: Option<[usize; 2]>,
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
    /// How far each node has slipped through the jaws, in the tool's frame [m].
    pub(crate) slid: Vec<Vec3A>,
    /// More than half of the nodes slip.
    pub(crate) slips: bool,
    /// The tissue tore out of it: it holds nothing any more.
    pub(crate) torn: bool,
}

impl Grasp {
    /// Captures `nodes` of `body` where they are now, with tool number `tool` at `pose`. Pinned nodes are left out.
    pub fn capture(model: &Model, state: &State, body: usize, nodes: &[u32], tool: usize, pose: &Pose) -> Self {
        let free = |i: &u32| !model.bodies[body].pinned()[*i as usize];
        let nodes: Vec<u32> = nodes.iter().copied().filter(free).collect();
        let captured = nodes.iter().map(|i| state.position(model, body, *i as usize)).collect();
        Self::new(tool, body, nodes, captured, pose)
    }

    /// Holds `nodes` of `body` such that, with tool number `tool` at `pose`, each is to be at its place of `positions` [m, world], wherever it is now. Pinned nodes are left out.
    pub fn prescribe(model: &Model, body: usize, nodes: &[u32], positions: &[DVec3], tool: usize, pose: &Pose) -> Self {
        let free = |(i, _): &(&u32, &DVec3)| !model.bodies[body].pinned()[**i as usize];
        let (nodes, captured) = nodes.iter().zip(positions).filter(free).map(|(i, x)| (*i, *x)).unzip();
        Self::new(tool, body, nodes, captured, pose)
    }

    fn new(tool: usize, body: usize, nodes: Vec<u32>, captured: Vec<DVec3>, pose: &Pose) -> Self {
        let slid = vec![Vec3A::ZERO; nodes.len()];
        Self { tool, body, nodes, captured, captured_at: *pose, compliance: None, slid, slips: false, torn: false }
    }

    /// The same grasp, giving way.
    pub fn compliant(self, compliance: Compliance) -> Self {
        Self { compliance: Some(compliance), ..self }
    }

    /// Whether the tissue tore out of it: it holds nothing any more.
    pub fn is_torn(&self) -> bool {
        self.torn
    }

    /// Whether the tissue slips through the jaws.
    pub fn slips(&self) -> bool {
        self.slips
    }

    /// Mean slip of its nodes through the jaws since it was made, in the tool's frame [m].
    pub fn slip(&self) -> DVec3 {
        let sum: DVec3 = self.slid.iter().map(|s| s.as_dvec3()).sum();
        sum / self.nodes.len().max(1) as f64
    }

    /// Whether its nodes hang on it compliantly.
    pub(crate) fn hangs(&self) -> bool {
        self.compliance.is_some() && !self.torn
    }

    /// [`Grasp::prescribed`] of one node by its place in `nodes`.
    pub(crate) fn prescribed_node(&self, tool: &Pose, k: usize) -> (u32, DVec3) {
        let from = &self.captured_at;
        let arm = self.captured[k] - from.translation;
        let turned = tool.rotation != from.rotation;
        let swing = if turned { tool.rotation * from.rotation.inverse() * arm - arm } else { DVec3::ZERO };
        (self.nodes[k], self.captured[k] + (swing + (tool.translation - from.translation)))
    }

    /// Whether it slips or tears, from what its nodes did in the last substep.
    pub(crate) fn judge<'a>(&mut self, held: impl Iterator<Item = &'a Hanging>, events: &mut Vec<Event>) {
        let Some(compliance) = self.compliance.filter(|_| !self.torn) else { return };
        let (mut sliding, mut nodes, mut pull) = (0, 0, DVec3::ZERO);
        for node in held {
            sliding += usize::from(node.slides);
            nodes += 1;
            pull += node.pull.as_dvec3();
        }
        let (tool, body, force) = (self.tool, self.body, pull.length());
        let slips = 2 * sliding > nodes;
        if slips && !self.slips {
            events.push(Event::Slipped { tool, body });
        }
        self.slips = slips;
        if force > compliance.tear_force {
            (self.torn, self.slips) = (true, false);
            events.push(Event::Torn { tool, body, force });
        }
    }

    /// Where each held node is to be when the tool is at `tool`: (node, world position [m]).
    pub fn prescribed(&self, tool: &Pose) -> impl Iterator<Item = (u32, DVec3)> {
        let tool = *tool;
        (0..self.nodes.len()).map(move |k| self.prescribed_node(&tool, k))
    }
}
