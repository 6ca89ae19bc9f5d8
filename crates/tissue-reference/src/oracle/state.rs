//! The oracle's state: positions and velocities in double precision.

use crate::{Error, Result};
use glam::DVec3;
use std::collections::BTreeMap;
use trocar_core::Pose;
use trocar_tissue::{Body, BodyMotion, Grasp, Model, State};

/// A node whose position at the end of a step is prescribed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The body.
    pub body: usize,
    /// Its node.
    pub node: u32,
    /// Its target, in the world (m).
    pub target: DVec3,
}

impl Held {
    /// The nodes of `grasp` when the tool is at `tool`.
    pub fn by(grasp: &Grasp, tool: &Pose) -> Vec<Self> {
        grasp.prescribed(tool).map(|(node, target)| Self { body: grasp.body, node, target }).collect()
    }
}

/// Positions and velocities at one instant, in double precision, nodes in their original order.
#[derive(Clone, Debug, PartialEq)]
pub struct OracleState {
    /// Simulated time (s).
    pub time: f64,
    pub(crate) bodies: Vec<Nodes>,
    /// How far friction's springs at tools and between bodies are stretched.
    pub(crate) stretches: Stretches,
}

/// How far friction's springs at tools and between bodies are stretched, in the world (m).
pub(crate) type Stretches = BTreeMap<TouchKey, DVec3>;

/// The object that a node or feature touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Touched {
    /// The model's collider of this number.
    Collider(usize),
    /// A body.
    Body(usize),
}

/// The name of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TouchKey {
    pub touched: Touched,
    /// The nodes that touch, among all of the model, ascending.
    pub nodes: [u32; 3],
    /// The end of an axis.
    pub end: u8,
}

/// A body's nodes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nodes {
    /// World positions (m).
    pub x: Vec<DVec3>,
    /// Velocities (m/s).
    pub v: Vec<DVec3>,
    /// Where friction holds each node at each support, support by support (m); empty: nowhere yet.
    pub anchors: Vec<Option<DVec3>>,
}

impl OracleState {
    /// The model at rest in its rest shape.
    pub fn new(model: &Model) -> Self {
        let at_rest = |body: &Body| {
            let x = body.rest_positions().to_vec();
            Nodes { v: vec![DVec3::ZERO; x.len()], x, anchors: Vec::new() }
        };
        Self { time: 0.0, bodies: model.bodies().iter().map(at_rest).collect(), stretches: Stretches::new() }
    }

    /// The motion of a stepper's state, without its grasps; [`Held`] replaces them. Friction at
    /// tools and between bodies holds everything where it is.
    pub fn from_state(model: &Model, state: &State) -> Self {
        let nodes = |(index, body): (usize, &Body)| Nodes::new(body, &state.motion(model, index));
        let bodies = model.bodies().iter().enumerate().map(nodes).collect();
        Self { time: state.time, bodies, stretches: Stretches::new() }
    }

    /// A stepper's state of the same motion, rounded to `f32`, without grasps and without the
    /// stretch of friction's springs at tools and between bodies. The accelerations for the
    /// adaptive start are the change of velocity since `before`, the oracle's state a step of `dt`
    /// (s) earlier.
    ///
    /// # Errors
    /// States of another model or that are not finite; a `dt` that is not above 0.
    pub fn to_state(&self, model: &Model, before: &OracleState, dt: f64) -> Result<State> {
        self.check(model, &[])?;
        before.check(model, &[])?;
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("a step of {dt} s; it must be above 0")));
        }
        let mut state = State::new(model);
        state.time = self.time;
        for (k, body) in model.bodies().iter().enumerate() {
            let (now, earlier) = (&self.bodies[k], &before.bodies[k]);
            let mut motion = state.motion(model, k);
            now.write(body, &mut motion);
            state.set_motion(model, k, &motion);
            let accelerations: Vec<DVec3> =
                now.v.iter().zip(&earlier.v).map(|(v, before)| (*v - *before) / dt).collect();
            state.set_accelerations(model, k, &accelerations);
        }
        Ok(state)
    }

    /// The same with a body's nodes at `x` (m), such as a guess from which
    /// [`Oracle::settle`](super::Oracle::settle) begins. A list of another length changes nothing.
    pub fn with_positions(mut self, body: usize, x: &[DVec3]) -> Self {
        if let Some(nodes) = self.bodies.get_mut(body).filter(|nodes| nodes.x.len() == x.len()) {
            nodes.x.copy_from_slice(x);
        }
        self
    }

    /// World positions of a body's nodes (m).
    pub fn positions(&self, body: usize) -> &[DVec3] {
        &self.bodies[body].x
    }

    /// Velocities of a body's nodes (m/s).
    pub fn velocities(&self, body: usize) -> &[DVec3] {
        &self.bodies[body].v
    }

    /// World positions of a body's nodes, to be changed (m).
    pub fn positions_mut(&mut self, body: usize) -> &mut [DVec3] {
        &mut self.bodies[body].x
    }

    /// Velocities of a body's nodes, to be changed (m/s).
    pub fn velocities_mut(&mut self, body: usize) -> &mut [DVec3] {
        &mut self.bodies[body].v
    }

    /// Checks that it fits the model.
    pub(super) fn check(&self, model: &Model, held: &[Held]) -> Result<()> {
        let same = self.bodies.len() == model.bodies().len()
            && self.bodies.iter().zip(model.bodies()).all(|(s, b)| s.x.len() == b.len());
        if !same {
            return Err(Error::Invalid("the oracle's state belongs to another model".to_owned()));
        }
        for (nodes, body) in self.bodies.iter().zip(model.bodies()) {
            if let Some(i) = (0..body.len()).find(|i| !(nodes.x[*i].is_finite() && nodes.v[*i].is_finite())) {
                let reason = format!("node {i} is at {} with velocity {}; both must be finite", nodes.x[i], nodes.v[i]);
                return Err(Error::Tissue(trocar_tissue::Error::Body { body: body.name().to_owned(), reason }));
            }
        }
        for h in held {
            let nodes = model.bodies().get(h.body).map_or(0, Body::len);
            if h.node as usize >= nodes || !h.target.is_finite() {
                let (body, node, target) = (h.body, h.node, h.target);
                return Err(Error::Invalid(format!(
                    "node {node} of body {body} (which has {nodes}) is held at {target}"
                )));
            }
        }
        Ok(())
    }
}

impl Nodes {
    /// The nodes of some bodies, one after the other.
    pub fn joined(bodies: &[Self]) -> Self {
        Self {
            x: bodies.iter().flat_map(|b| &b.x).copied().collect(),
            v: bodies.iter().flat_map(|b| &b.v).copied().collect(),
            anchors: bodies.iter().flat_map(|b| &b.anchors).copied().collect(),
        }
    }

    /// The nodes of a stepper's motion.
    pub fn new(body: &Body, motion: &BodyMotion) -> Self {
        Self {
            x: motion.positions.iter().map(|x| body.origin() + *x).collect(),
            v: motion.velocities.clone(),
            anchors: motion.anchors.iter().map(|place| place.map(|x| body.origin() + x)).collect(),
        }
    }

    /// Writes them into a stepper's motion.
    pub fn write(&self, body: &Body, motion: &mut BodyMotion) {
        motion.positions.iter_mut().zip(&self.x).for_each(|(to, x)| *to = *x - body.origin());
        motion.velocities.clone_from(&self.v);
        motion.anchors.clear();
        motion.anchors.extend(self.anchors.iter().map(|place| place.map(|x| x - body.origin())));
    }
}
