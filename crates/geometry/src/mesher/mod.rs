//! Meshers: from a shape to a tetrahedral body.

mod bcc;
mod body;
mod cuts;
mod lattice;
mod stencil;

pub use lattice::LatticeMesher;

use crate::{Result, SignedDistance, TetMesh};
use glam::DVec3;

/// Fills a shape with tetrahedra.
pub trait Mesher {
    /// Meshes the inside of `shape`, which lies within `bounds` [m]. One connected body, every element positive.
    fn mesh(&self, shape: &dyn SignedDistance, bounds: (DVec3, DVec3)) -> Result<TetMesh>;
}
