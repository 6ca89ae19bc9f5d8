//! How a grasp begins: on nodes where they are, or at prescribed places.

use super::State;
use crate::{Grasp, Model};
use glam::{DVec3, Vec3A};
use trocar_core::Pose;

impl Grasp {
    /// Captures `nodes` of `body` where they are now, with tool number `tool` at `pose`. Pinned
    /// nodes are left out.
    pub fn capture(model: &Model, state: &State, body: usize, nodes: &[u32], tool: usize, pose: &Pose) -> Self {
        let free = |i: &u32| !model.bodies[body].pinned()[*i as usize];
        let nodes: Vec<u32> = nodes.iter().copied().filter(free).collect();
        let captured = nodes.iter().map(|i| state.position(model, body, *i as usize)).collect();
        Self::new(tool, body, nodes, captured, pose)
    }

    /// Holds `nodes` of `body` such that, with tool number `tool` at `pose`, each is to be at its
    /// place of `positions` (m, world), wherever it is now. Pinned nodes are left out.
    pub fn prescribe(model: &Model, body: usize, nodes: &[u32], positions: &[DVec3], tool: usize, pose: &Pose) -> Self {
        let free = |(i, _): &(&u32, &DVec3)| !model.bodies[body].pinned()[**i as usize];
        let (nodes, captured) = nodes.iter().zip(positions).filter(free).map(|(i, x)| (*i, *x)).unzip();
        Self::new(tool, body, nodes, captured, pose)
    }

    /// The grasp as it would have been captured in `here`, with the tool at `pose`, instead of in
    /// `there`, both states of `model`: each node is held as far from where it is here as there.
    pub fn captured_in(&self, model: &Model, there: &State, here: &State, pose: &Pose) -> Self {
        let at = |state: &State, node: u32| state.position(model, self.body, node as usize);
        let held = self.nodes.iter().zip(&self.captured);
        let captured = held.map(|(i, x)| *x + (at(here, *i) - at(there, *i))).collect();
        Self { compliance: self.compliance, ..Self::new(self.tool, self.body, self.nodes.clone(), captured, pose) }
    }

    fn new(tool: usize, body: usize, nodes: Vec<u32>, captured: Vec<DVec3>, pose: &Pose) -> Self {
        let slid = vec![Vec3A::ZERO; nodes.len()];
        Self { tool, body, nodes, captured, captured_at: *pose, compliance: None, slid, slips: false, torn: false }
    }
}
