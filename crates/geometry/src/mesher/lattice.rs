//! Isosurface stuffing on a body-centred cubic lattice.
//!
//! Labelle and Shewchuk, "Isosurface stuffing: fast tetrahedral meshes with good dihedral angles", SIGGRAPH 2007.

use super::Mesher;
use crate::{Result, SignedDistance, TetMesh};
use glam::DVec3;

/// The default mesher: no slivers by construction.
#[derive(Clone, Copy, Debug)]
pub struct LatticeMesher {
    /// Edge of the lattice's cubic cell [m]; the tets' edges are this long and 0.87 times this long.
    pub cell: f64,
}

impl LatticeMesher {
    /// Chooses the cell for a body of `volume` [m3]: `finest` [m], or larger so that about `max_tets` elements fill it.
    pub fn for_volume(volume: f64, finest: f64, max_tets: usize) -> Self {
        let _ = (volume, finest, max_tets);
        todo!()
    }
}

impl Mesher for LatticeMesher {
    fn mesh(&self, shape: &dyn SignedDistance, bounds: (DVec3, DVec3)) -> Result<TetMesh> {
        let _ = (shape, bounds);
        todo!()
    }
}
