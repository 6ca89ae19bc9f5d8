//! What changes while stepping: plain data.

use crate::Model;
use glam::DVec3;

/// Positions, velocities and grasps at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Simulated time [s].
    pub time: f64,
}

impl State {
    /// The model at rest in its rest shape.
    pub fn new(model: &Model) -> Self {
        let _ = model;
        todo!()
    }
    /// World position of a node [m].
    pub fn position(&self, model: &Model, body: usize, node: usize) -> DVec3 {
        let _ = (model, body, node);
        todo!()
    }
    /// World positions of a body's nodes [m].
    pub fn positions(&self, model: &Model, body: usize) -> Vec<DVec3> {
        let _ = (model, body);
        todo!()
    }
    /// Hash over every bit of the state.
    pub fn hash(&self) -> u64 {
        todo!()
    }
}
