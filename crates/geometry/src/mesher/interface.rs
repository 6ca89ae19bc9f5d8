//! The interface of all meshers.

use crate::{Result, TetMesh, TriMesh};

/// Fills a closed surface with tetrahedra.
pub trait Mesher: Sync {
    /// Fills the closed, outward `surface` (m) with tetrahedra. The result is one connected body of
    /// elements with positive volume.
    ///
    /// # Errors
    /// A surface that cannot be filled, with the reason in one line.
    fn mesh(&self, surface: &TriMesh) -> Result<TetMesh>;

    /// Name and settings, for messages and the provenance of a mesh.
    fn describe(&self) -> String;
}
