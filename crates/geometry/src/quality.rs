//! How good the elements of a tetrahedral mesh are.

use crate::TetMesh;

/// Element quality of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetQuality {
    /// Smallest dihedral angle over all elements [degrees].
    pub min_dihedral_deg: f64,
    /// Median over elements of each element's smallest dihedral angle [degrees].
    pub median_min_dihedral_deg: f64,
    /// Largest dihedral angle over all elements [degrees].
    pub max_dihedral_deg: f64,
    /// Median edge length [m].
    pub median_edge: f64,
    /// Elements with signed volume at or below 0.
    pub inverted: usize,
    /// Volume [m3].
    pub volume: f64,
}

impl TetQuality {
    /// Measures `mesh`; all zero for an empty one.
    pub fn of(mesh: &TetMesh) -> Self {
        let _ = mesh;
        todo!()
    }
}
