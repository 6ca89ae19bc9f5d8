//! Where along an organ a node lies: the organ coordinate s.

use crate::{Result, TetMesh};
use glam::DVec3;

/// The centreline of an organ and the organ coordinate of each of its nodes.
///
/// s is arc length along the centreline over its whole length, 0 at the base and 1 at the tip. The centreline runs through
/// the centroids of the level sets of a harmonic field between the two ends, so it follows a curved tube.
#[derive(Clone, Debug)]
pub struct OrganAxis {
    /// Points along the centreline, base first [m].
    pub centreline: Vec<DVec3>,
    /// Length of the centreline [m].
    pub length: f64,
    /// Organ coordinate of each node, 0..=1.
    pub s: Vec<f64>,
}

impl OrganAxis {
    /// Finds the axis of `mesh`. The ends are the two nodes farthest apart through the mesh; `base_hint` [m] says which is
    /// the base (the end nearer to it).
    pub fn of(mesh: &TetMesh, base_hint: DVec3) -> Result<Self> {
        let _ = (mesh, base_hint);
        todo!()
    }

    /// Point at organ coordinate `s` on the centreline [m].
    pub fn point_at(&self, s: f64) -> DVec3 {
        let _ = s;
        todo!()
    }
}
