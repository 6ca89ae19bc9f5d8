//! Tetrahedral bodies.

use crate::TriMesh;
use glam::DVec3;

/// A tetrahedral mesh. Every element [a, b, c, d] has positive signed volume (b-a)x(c-a).(d-a)/6.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Node positions [m].
    pub vertices: Vec<DVec3>,
    /// Node indices of each element.
    pub tets: Vec<[u32; 4]>,
}

impl TetMesh {
    /// Signed volume of element `t` [m3].
    pub fn tet_volume(&self, t: usize) -> f64 {
        let _ = t;
        todo!()
    }

    /// Sum of the signed volumes [m3].
    pub fn volume(&self) -> f64 {
        todo!()
    }

    /// Number of elements with signed volume at or below 0.
    pub fn inverted(&self) -> usize {
        todo!()
    }

    /// Outward-facing boundary surface and, for each of its vertices, the node it is.
    pub fn boundary(&self) -> (TriMesh, Vec<u32>) {
        todo!()
    }

    /// Smallest and largest coordinates [m]; `None` without nodes.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        todo!()
    }
}
