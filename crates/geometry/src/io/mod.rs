//! Mesh files.

use crate::{Error, Result, TetMesh, TriMesh};
use std::path::Path;

/// Unit of the lengths in a file that does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Millimetres.
    Millimetre,
    /// Centimetres.
    Centimetre,
    /// Metres.
    Metre,
}

/// Reads a surface from `.stl` (binary or text), `.ply` (with vertex colours if there are any) or `.obj`, into metres.
pub fn read_surface(path: &Path, unit: Unit) -> Result<TriMesh> {
    let _ = (path, unit);
    todo!()
}

/// Writes a binary little-endian `.ply` in metres, with vertex colours when the mesh has them.
pub fn write_ply(path: &Path, mesh: &TriMesh) -> Result<()> {
    let _ = (path, mesh);
    todo!()
}

/// Reads the tetrahedra of a Gmsh `.msh` file (2.2 or 4.1, text or binary little-endian), in metres. Turns negative
/// elements; refuses an element without volume.
pub fn read_msh(path: &Path) -> Result<TetMesh> {
    let _ = path;
    todo!()
}

/// Writes a Gmsh 4.1 binary `.msh`, in metres.
pub fn write_msh(path: &Path, mesh: &TetMesh) -> Result<()> {
    let _ = (path, mesh);
    Err(Error::Mesh("unwritten".into()))
}
