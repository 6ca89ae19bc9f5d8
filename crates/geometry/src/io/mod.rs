//! Mesh files.

mod msh;
mod obj;
mod ply;
mod stl;

pub use msh::{read_msh, write_msh};
pub use ply::write_ply;

use crate::{Error, Result, TriMesh};
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

impl Unit {
    /// Metres in one of this unit.
    pub fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Metre => 1.0,
        }
    }
}

/// Reads a surface from `.stl` (binary or text), `.ply` (with vertex colours if there are any) or `.obj`, into metres.
///
/// # Errors
/// Names the file when it is missing, truncated, of another format, has vertices that are not finite, or has no triangle.
pub fn read_surface(path: &Path, unit: Unit) -> Result<TriMesh> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let parse = match extension.as_str() {
        "stl" => stl::parse,
        "ply" => ply::parse,
        "obj" => obj::parse,
        other => return Err(wrong(path, format!("'.{other}' is not a surface format; .stl, .ply and .obj are"))),
    };
    let mut mesh = parse(&read(path)?).map_err(|reason| wrong(path, reason))?;
    mesh.check().map_err(|e| wrong(path, e.to_string()))?;
    if mesh.triangles.is_empty() {
        return Err(wrong(path, "there is no triangle in it".to_owned()));
    }
    for v in &mut mesh.vertices {
        *v *= unit.metres();
    }
    Ok(mesh)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.to_owned(), source })
}

fn wrong(path: &Path, reason: String) -> Error {
    Error::Parse { path: path.to_owned(), reason }
}
