//! What tasks measure of a cell beside its observations: what jaws carry and what is between
//! blades.

use super::Cell;
use crate::gripper::{BLADE_WIDTH, MOUTH_BEGIN};
use crate::{Mouthful, Result};
use glam::DVec3;
use trocar_scene::{InstrumentKind, Side};

/// Tissue that jaws hold, and how it has moved since they closed on it (SPEC, lift and slip).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried {
    /// Body of the tissue.
    pub organ: usize,
    /// Organ coordinate of the attached cluster.
    pub s: f64,
    /// Rise of the jaws [m].
    pub jaw_lift: f64,
    /// Rise of the tissue's centroid [m].
    pub tissue_lift: f64,
    /// Distance of that centroid in the jaws' frame from where it was [m].
    pub slip: f64,
}

impl Cell {
    /// The arms in the order of observations and actions, with what their instruments are.
    pub fn arms(&self) -> Vec<(Side, InstrumentKind)> {
        self.stations.iter().map(|s| (s.fixed.side, s.fixed.kind)).collect()
    }

    /// What the arm at place `k` holds; None where there is no such arm or it holds nothing.
    pub fn carried(&self, k: usize) -> Option<Carried> {
        let station = self.stations.get(k)?;
        let held = station.now.held.as_ref()?;
        let moved = station.moved(&self.world)?;
        let (organ, s) = (held.organ, held.s);
        Some(Carried { organ, s, jaw_lift: moved.jaw_lift, tissue_lift: moved.tissue_lift, slip: moved.slip })
    }

    /// Tissue of body `organ` between the blades of the arm at place `k` (SPEC C3), and its share
    /// of the wedge between them; None where there is none.
    pub fn between_blades(&self, k: usize, organ: usize) -> Option<(Mouthful, f64)> {
        let station = self.stations.get(k)?;
        let tissue = station.mouth().tissue_of(&self.world, organ)?;
        let (angle, length) = (station.now.gripper.jaw_angle, station.fixed.blades.length);
        // A sector of a ring, as wide as the blades.
        let wedge = 0.5 * angle * (length * length - MOUTH_BEGIN * MOUTH_BEGIN) * BLADE_WIDTH;
        Some((tissue, if wedge > 0.0 { (tissue.volume / wedge).min(1.0) } else { 0.0 }))
    }

    /// Tip of an arm's closed blades in the cell [m].
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn blade_tip(&self, arm: &str) -> Result<DVec3> {
        let station = self.arm(arm)?;
        Ok(station.manipulator.measured_cp().transform(station.fixed.blades.length * DVec3::X))
    }

    /// Whether an arm's instrument has hooked or crushed tissue and passes through it until it has
    /// come back.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn unhooked(&self, arm: &str) -> Result<bool> {
        Ok(self.arm(arm)?.now.unhooked)
    }
}
