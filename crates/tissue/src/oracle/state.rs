//! The oracle's state: positions and velocities in double precision.

use crate::contact::{Anchor, Source};
use crate::state::BodyState;
use crate::{Body, Error, Grasp, Model, Result, State};
use glam::DVec3;
use trocar_core::Pose;

/// A node whose position at the end of a step is prescribed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// The body.
    pub body: usize,
    /// Its node.
    pub node: u32,
    /// Where it is to be, in the world [m].
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
    /// Simulated time [s].
    pub time: f64,
    pub(crate) bodies: Vec<Nodes>,
}

/// A body's nodes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Nodes {
    /// World positions [m].
    pub x: Vec<DVec3>,
    /// Velocities [m/s].
    pub v: Vec<DVec3>,
    /// Where friction holds each node at each support, support by support [m]; empty: nowhere yet.
    pub anchors: Vec<Option<DVec3>>,
}

impl OracleState {
    /// The model at rest in its rest shape.
    pub fn new(model: &Model) -> Self {
        let at_rest = |body: &crate::Body| {
            let x = body.rest_positions().to_vec();
            Nodes { v: vec![DVec3::ZERO; x.len()], x, anchors: Vec::new() }
        };
        Self { time: 0.0, bodies: model.bodies.iter().map(at_rest).collect() }
    }

    /// A stepper's state of the same model, without its grasp: that is said to the oracle by [`Held`].
    pub fn from_state(model: &Model, state: &State) -> Self {
        let nodes = |body: usize| {
            let velocity = |node| state.velocity(model, body, node);
            let v = (0..model.bodies[body].len()).map(velocity).collect();
            Nodes { x: state.positions(model, body), v, anchors: anchors(&model.bodies[body], &state.bodies[body]) }
        };
        Self { time: state.time, bodies: (0..model.bodies.len()).map(nodes).collect() }
    }

    /// A stepper's state of the same motion, rounded to `f32`, without grasps. What the adaptive start is to know of the acceleration is taken from `before`, the oracle's state
    /// a step of `dt` [s] earlier.
    ///
    /// # Errors
    /// States of another model or that are not finite; a `dt` that is not above 0.
    pub fn to_state(&self, model: &Model, before: &OracleState, dt: f64) -> Result<State> {
        self.check(model, &[])?;
        before.check(model, &[])?;
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Model(format!("a step of {dt} s; it must be above 0")));
        }
        let strength = model.gravity.length_squared();
        let mut state = State::new(model);
        state.time = self.time;
        for (k, body) in model.bodies.iter().enumerate() {
            let (to, now, earlier) = (&mut state.bodies[k], &self.bodies[k], &before.bodies[k]);
            set_anchors(body, &now.anchors, to);
            for (node, i) in body.internal.iter().enumerate() {
                let i = *i as usize;
                to.x[i] = (now.x[node] - body.origin).as_vec3a();
                to.v[i] = now.v[node].as_vec3a();
                if strength > 0.0 {
                    let acceleration = (now.v[node] - earlier.v[node]) / dt;
                    to.falling[i] = (acceleration.dot(model.gravity) / strength).clamp(0.0, 1.0) as f32;
                }
            }
        }
        Ok(state)
    }

    /// World positions of a body's nodes [m].
    pub fn positions(&self, body: usize) -> &[DVec3] {
        &self.bodies[body].x
    }

    /// Velocities of a body's nodes [m/s].
    pub fn velocities(&self, body: usize) -> &[DVec3] {
        &self.bodies[body].v
    }

    /// World positions of a body's nodes, to be changed [m].
    pub fn positions_mut(&mut self, body: usize) -> &mut [DVec3] {
        &mut self.bodies[body].x
    }

    /// Velocities of a body's nodes, to be changed [m/s].
    pub fn velocities_mut(&mut self, body: usize) -> &mut [DVec3] {
        &mut self.bodies[body].v
    }

    /// Refuses what does not fit the model.
    pub(super) fn check(&self, model: &Model, held: &[Held]) -> Result<()> {
        let same = self.bodies.len() == model.bodies.len()
            && self.bodies.iter().zip(&model.bodies).all(|(s, b)| s.x.len() == b.len());
        if !same {
            return Err(Error::Model("the oracle's state belongs to another model".to_owned()));
        }
        for (nodes, body) in self.bodies.iter().zip(&model.bodies) {
            if let Some(i) = (0..body.len()).find(|i| !(nodes.x[*i].is_finite() && nodes.v[*i].is_finite())) {
                let reason = format!("node {i} is at {} with velocity {}; both must be finite", nodes.x[i], nodes.v[i]);
                return Err(Error::Body { body: body.name.clone(), reason });
            }
        }
        for h in held {
            let nodes = model.bodies.get(h.body).map_or(0, crate::Body::len);
            if h.node as usize >= nodes || !h.target.is_finite() {
                let (body, node, target) = (h.body, h.node, h.target);
                return Err(Error::Model(format!(
                    "node {node} of body {body} (which has {nodes}) is held at {target}"
                )));
            }
        }
        Ok(())
    }
}

/// Where friction holds a body's nodes at its supports, support by support [m].
pub(super) fn anchors(body: &Body, state: &BodyState) -> Vec<Option<DVec3>> {
    let mut node_of = vec![0; body.len()];
    body.internal.iter().enumerate().for_each(|(node, i)| node_of[*i as usize] = node);
    let mut anchors = vec![None; body.supports.len() * body.len()];
    for anchor in &state.anchors {
        if let Source::Support(s) = anchor.source {
            let k = s as usize * body.len() + node_of[anchor.vertex as usize];
            anchors[k] = Some(body.origin + anchor.place.as_dvec3());
        }
    }
    anchors
}

/// Gives a stepper's state of a body those anchors.
pub(super) fn set_anchors(body: &Body, anchors: &[Option<DVec3>], state: &mut BodyState) {
    state.anchors.retain(|anchor| !matches!(anchor.source, Source::Support(_)));
    for (k, place) in anchors.iter().enumerate() {
        if let Some(place) = place {
            let (vertex, source) = (body.internal[k % body.len()], Source::Support((k / body.len()) as u32));
            state.anchors.push(Anchor { vertex, source, place: (*place - body.origin).as_vec3a() });
        }
    }
    state.anchors.sort_unstable_by_key(|anchor| (anchor.vertex, anchor.source));
}
