//! Measures of tasks that observations do not contain: tissue that jaws hold, and tissue between
//! blades.

use super::Cell;
use crate::gripper::{BLADE_WIDTH, JAW_REGION_BEGIN};
use crate::{Result, TissueInJaws};
use glam::DVec3;
use trocar_scene::{InstrumentKind, Side};
use trocar_tissue::State;

/// Tissue that jaws hold, and its motion since they closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Body of the tissue.
    pub organ: usize,
    /// Organ coordinate of the attached cluster.
    pub s: f64,
    /// Rise of the jaws (m).
    pub jaw_lift: f64,
    /// Rise of the tissue's centroid (m).
    pub tissue_lift: f64,
    /// Motion of that centroid in the jaws' frame (m).
    pub slip: f64,
}

impl Cell {
    /// The arms in the order of observations and actions, with the kinds of their instruments.
    pub fn arms(&self) -> Vec<(Side, InstrumentKind)> {
        self.arms.iter().map(|s| (s.model.side, s.model.kind)).collect()
    }

    /// The tissue that arm `k` holds; `None` if it holds nothing or does not exist.
    pub fn carried(&self, k: usize) -> Option<Carried> {
        let arm = self.arms.get(k)?;
        let held = arm.state.held.as_ref()?;
        let moved = arm.moved(&self.world)?;
        let (organ, s) = (held.organ, held.s);
        Some(Carried { organ, s, jaw_lift: moved.jaw_lift, tissue_lift: moved.tissue_lift, slip: moved.slip })
    }

    /// Organ coordinates of the nodes that arm `k` holds; empty if it holds nothing.
    pub fn carried_coordinates(&self, k: usize) -> Vec<f64> {
        let held = self.arms.get(k).and_then(|arm| arm.state.held.as_ref());
        held.map_or_else(Vec::new, |held| {
            let (organ, nodes) = held.hold.tissue();
            nodes.iter().map(|i| self.world.axes[organ].s[*i as usize]).collect()
        })
    }

    /// Body and nodes of the tissue that arm `k` holds; `None` if it holds nothing.
    pub fn carried_nodes(&self, k: usize) -> Option<(usize, &[u32])> {
        self.arms.get(k)?.state.held.as_ref().map(|held| held.hold.tissue())
    }

    /// Tissue of body `organ` between the blades of arm `k`, and its share of the region between
    /// them; `None` without tissue there.
    pub fn between_blades(&self, k: usize, organ: usize) -> Option<(TissueInJaws, f64)> {
        let arm = self.arms.get(k)?;
        let tissue = arm.jaw_region().tissue_of(&self.world, organ)?;
        let (angle, length) = (arm.state.gripper.jaw_angle, arm.model.blades.length);
        // A sector of a ring, as wide as the blades.
        let wedge = 0.5 * angle * (length * length - JAW_REGION_BEGIN * JAW_REGION_BEGIN) * BLADE_WIDTH;
        Some((tissue, if wedge > 0.0 { (tissue.volume / wedge).min(1.0) } else { 0.0 }))
    }

    /// Tip of an arm's closed blades in the cell (m).
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn blade_tip(&self, arm: &str) -> Result<DVec3> {
        let arm = self.arm(arm)?;
        Ok(arm.drive.tip().transform(arm.model.blades.length * DVec3::X))
    }

    /// Whether the axis of an arm's instrument is inside an organ that its jaws do not hold.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn pierces(&self, arm: &str) -> Result<bool> {
        Ok(self.arm(arm)?.state.pierces)
    }

    /// Largest distance of a pinned node from its recorded position (m). A state stores positions
    /// in single precision, so the recorded ones are rounded in the same way.
    pub fn pin_drift(&self) -> f64 {
        let (model, state) = (&self.world.model, &self.world.state);
        let recorded = &State::new(model);
        let drift = model.bodies().iter().enumerate().flat_map(|(k, body)| {
            let pinned = (0..body.len()).filter(|i| body.pinned()[*i]);
            pinned.map(move |i| state.position(model, k, i).distance(recorded.position(model, k, i)))
        });
        drift.fold(0.0, f64::max)
    }

    /// Weight of the tissue of `bodies` (N).
    pub fn weight(&self, bodies: &[usize]) -> f64 {
        let all = self.world.model.bodies();
        let mass = bodies.iter().flat_map(|k| (0..all[*k].len()).map(|i| all[*k].mass(i))).sum::<f64>();
        crate::world::GRAVITY * mass
    }
}
