//! The seam through which another crate provides an integrator: one body, one frame, in double
//! precision and node order.
//!
//! Such an integrator knows pins, grasps (all of them rigid), loads and supports. Bodies that it
//! steps pass through each other and through tools.

use crate::contact::{Anchor, Contacts, Source};
use crate::integrator::{Frame, Solver, Worker};
use crate::report::Divergence;
use crate::state::BodyState;
use crate::{Body, Grasp};
use glam::{DVec3, Vec3A};

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

/// The motion of a body in double precision, in node order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyMotion {
    /// Positions relative to [`Body::origin`] (m).
    pub positions: Vec<DVec3>,
    /// Velocities (m/s).
    pub velocities: Vec<DVec3>,
    /// Where friction holds each node at each support, relative to [`Body::origin`] (m), support by
    /// support; empty if it holds none.
    pub anchors: Vec<Option<DVec3>>,
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

impl BodyMotion {
    /// Takes the motion over from a body's state.
    pub(crate) fn load(&mut self, body: &Body, state: &BodyState) {
        let vertices = || body.internal.iter().map(|i| *i as usize);
        self.positions.clear();
        self.positions.extend(vertices().map(|i| state.x[i].as_dvec3()));
        self.velocities.clear();
        self.velocities.extend(vertices().map(|i| state.v[i].as_dvec3()));
        let nodes = body.nodes_of_vertices();
        self.anchors.clear();
        self.anchors.resize(body.supports.len() * body.len(), None);
        for anchor in &state.anchors {
            if let Source::Support(s) = anchor.source {
                let k = s as usize * body.len() + nodes[anchor.vertex as usize];
                self.anchors[k] = Some(anchor.place.as_dvec3());
            }
        }
    }

    /// Gives the motion to a body's state, rounded to single precision.
    pub(crate) fn store(&self, body: &Body, state: &mut BodyState) {
        for (node, i) in body.internal.iter().enumerate() {
            let i = *i as usize;
            state.x[i] = self.positions[node].as_vec3a();
            state.v[i] = self.velocities[node].as_vec3a();
            state.falling[i] = 0.0;
        }
        state.anchors.retain(|anchor| !matches!(anchor.source, Source::Support(_)));
        for (k, place) in self.anchors.iter().enumerate() {
            if let Some(place) = place {
                let (vertex, source) = (body.internal[k % body.len()], Source::Support((k / body.len()) as u32));
                let place: Vec3A = place.as_vec3a();
                state.anchors.push(Anchor { vertex, source, place });
            }
        }
        state.anchors.sort_unstable_by_key(|anchor| (anchor.vertex, anchor.source));
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
    const COUPLES: bool = false;

    fn advance(island: &mut [Worker<Self>], frame: &Frame<'_>) {
        for Worker { index, body, solver, state, report, .. } in island {
            let Self { integrator, motion } = solver;
            motion.load(body, state);
            let outcome = integrator.advance(&BodyFrame { body, frame: frame.of(*index) }, motion);
            motion.store(body, state);
            report.iterations += outcome.iterations;
            if outcome.unsolved {
                report.divergence = Some(Divergence::Unsolved { body: *index });
            }
        }
    }

    fn contacts(&self) -> Option<&Contacts> {
        None
    }
}
