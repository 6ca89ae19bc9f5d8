//! The seam through which another crate provides an integrator: one body, one frame, in double
//! precision and node order.
//!
//! Such an integrator knows pins, grasps (all of them rigid), loads and supports. Bodies that it
//! steps pass through each other and through tools.

use crate::body_slot::{BodySlot, IslandFrame, Solver};
use crate::frame::Frame;
use crate::report::Divergence;
use crate::state::BodyMotion;
use crate::{Body, Grasp};
use glam::DVec3;

/// An integrator of one body from outside this crate ([`crate::Stepper::with_integrator`]).
pub trait Integrator: Send + Sync {
    /// Advances the body's motion by a frame.
    fn advance(&mut self, frame: &BodyFrame<'_>, motion: &mut BodyMotion) -> Outcome;
}

/// How an [`Integrator`] stepped a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Iterations of all substeps.
    pub iterations: usize,
    /// Whether it gave up: the frame's report then says [`Divergence::Unsolved`].
    pub unsolved: bool,
}

/// What acts on a body during a frame.
pub struct BodyFrame<'a> {
    body: &'a Body,
    frame: Frame<'a>,
}

impl BodyFrame<'_> {
    /// The body.
    pub fn body(&self) -> &Body {
        self.body
    }

    /// Length of the frame (s).
    pub fn dt(&self) -> f64 {
        self.frame.dt
    }

    /// Gravitational acceleration (m/s2).
    pub fn gravity(&self) -> DVec3 {
        self.frame.gravity
    }

    /// Nodes that tools hold.
    pub fn held_nodes(&self) -> impl Iterator<Item = u32> {
        self.frame.grasps().flat_map(|grasp: &Grasp| grasp.nodes.iter().copied())
    }

    /// Where held nodes are to be when `share` (0..=1) of the frame is over: node and world
    /// position (m). Nodes held by a tool without a motion stay where they are and are left out.
    pub fn targets(&self, share: f64) -> impl Iterator<Item = (u32, DVec3)> {
        self.frame.grasps().flat_map(move |grasp| {
            let tool = self.frame.tools.get(grasp.tool);
            tool.into_iter().flat_map(move |tool| {
                let pose = tool.at(share);
                (0..grasp.nodes.len()).map(move |k| grasp.prescribed_node(&pose, k))
            })
        })
    }

    /// Forces on nodes (N) throughout the frame.
    pub fn loads(&self) -> impl Iterator<Item = (usize, DVec3)> {
        let of_body = self.frame.loads.iter().filter(|load| load.body == self.frame.index);
        of_body.map(|load| (load.node, load.force))
    }
}

/// An integrator from outside as a solver of the stepper.
pub(crate) struct ExternalSolver {
    integrator: Box<dyn Integrator>,
    motion: BodyMotion,
}

impl ExternalSolver {
    pub fn new(integrator: Box<dyn Integrator>) -> Self {
        Self { integrator, motion: BodyMotion::default() }
    }
}

impl Solver for ExternalSolver {
    type History = ();
    const COUPLES: bool = false;

    fn new_history(&self) {}

    fn substeps(&self) -> usize {
        1
    }

    fn substep(island: &mut IslandFrame<'_, Self>, _from: f64, _to: f64) {
        for BodySlot { index, body, solver, state, report, .. } in island.slots.iter_mut() {
            let Self { integrator, motion } = solver;
            motion.load(body, state);
            let outcome = integrator.advance(&BodyFrame { body, frame: island.frame.of(*index) }, motion);
            motion.store(body, state);
            report.iterations += outcome.iterations;
            if outcome.unsolved {
                report.divergence = Some(Divergence::Unsolved { body: *index });
            }
        }
    }
}
