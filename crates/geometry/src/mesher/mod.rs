//! Meshers: from a shape to a tetrahedral body.

mod bcc;
mod body;
#[cfg(test)]
mod bound;
mod cuts;
mod fill;
mod lattice;
mod octree;
mod stencil;
mod tetgen;

pub use lattice::LatticeMesher;
pub use tetgen::TetgenMesher;

use crate::{Result, TetMesh, TriMesh};

/// Fills a closed surface with tetrahedra.
pub trait Mesher: Sync {
    /// Fills the closed, outward `surface` [m] with tets: one connected body, every element positive.
    ///
    /// # Errors
    /// A surface that cannot be filled, in one line that says why.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh>;

    /// Name and settings, for people and for the record of where a mesh came from.
    fn describe(&self) -> String;
}
