//! Which bodies may touch in a frame, and where.

use super::proximity::{Limits, Near, Proximity};
use crate::frame::Frame;
use crate::{BodyContact, Model, State};

/// Bodies that are farther apart than where they press, what they travel in a frame and this margin
/// (m) are not examined.
const FRAME_MARGIN: f32 = 5e-4;

/// Steps of the reach (m).
const REACH_STEP: f32 = 1e-3;

/// Finds which bodies may touch at the beginning of every frame, and their islands.
pub(crate) struct Coupling {
    contact: BodyContact,
    proximity: Proximity,
    near: Vec<Near>,
    /// Upper bound of how far each body goes in the frame (m).
    ways: Vec<f32>,
    /// A body of the same island with a smaller number, or the body itself.
    parents: Vec<u32>,
}

impl Coupling {
    pub fn new(model: &Model, contact: BodyContact) -> Self {
        let limits = Limits { offset: contact.offset as f32, depth: contact.depth as f32, folds: contact.folds };
        Self {
            contact,
            proximity: Proximity::new(model, limits),
            near: Vec::new(),
            ways: vec![0.0; model.bodies.len()],
            parents: (0..model.bodies.len() as u32).collect(),
        }
    }

    /// Finds the pairs for the bodies as they are at the frame's beginning.
    pub fn find(&mut self, model: &Model, state: &State, frame: &Frame<'_>) {
        let dt = frame.dt as f32;
        let fall = dt * dt * frame.gravity.length() as f32;
        self.proximity.refit(model, &state.bodies);
        for (b, (body, way)) in state.bodies.iter().zip(&mut self.ways).enumerate() {
            let fastest = body.v.iter().map(|v| v.length_squared()).fold(0.0, f32::max).sqrt();
            let here = frame.of(b);
            let carried = here.carried(&model.bodies[b], false);
            let model = &model.bodies[b];
            // A pinned body does not fall.
            let falls = if model.pinned.contains(&true) { 0.0 } else { fall };
            let pushed = here.pushes(model, |reaches| self.proximity.meets(model, b, reaches));
            *way = carried.max(pushed) as f32 + dt * fastest + falls;
        }
        let ways = &self.ways;
        // In steps, so that bodies at rest are not examined again while tools come nearer.
        let stepped = |reach: f32| (reach / REACH_STEP).ceil() * REACH_STEP;
        let reach = |a: usize, b: usize| stepped(self.contact.offset as f32 + FRAME_MARGIN + ways[a] + ways[b]);
        self.proximity.find(model, &state.bodies, reach, &mut self.near);
        self.parents.iter_mut().enumerate().for_each(|(b, parent)| *parent = b as u32);
        for k in 0..self.near.len() {
            let (a, b) = (self.island(self.near[k].body as usize), self.island(self.near[k].other as usize));
            self.parents[a.max(b)] = a.min(b) as u32;
        }
    }

    /// The island of a body: the number of its first body.
    pub fn island(&self, body: usize) -> usize {
        let mut at = body;
        while self.parents[at] as usize != at {
            at = self.parents[at] as usize;
        }
        at
    }

    /// Pairs that may touch, by body, vertex and other body.
    pub fn near(&self) -> &[Near] {
        &self.near
    }

    pub fn contact(&self) -> BodyContact {
        self.contact
    }
}
