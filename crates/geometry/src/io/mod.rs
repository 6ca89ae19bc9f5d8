//! Mesh files.

mod msh;
mod obj;
mod ply;
mod stl;

pub use msh::{read_msh, read_msh_groups, write_msh};
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
    /// Metres in one of the unit.
    pub fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Metre => 1.0,
        }
    }
}

/// Reads a surface from `.stl` (binary or text), `.ply` (with vertex colours if there are any) or
/// `.obj`, into metres. The vertices are those of the file: in an STL file every triangle has its
/// own (see [`repair`](crate::repair)).
///
/// # Errors
/// [`Error::Io`] if the file cannot be read. [`Error::Parse`] for another extension, content that
/// is damaged or cut short, an index out of range, a vertex that is not finite, or no triangles.
pub fn read_surface(path: &Path, unit: Unit) -> Result<TriMesh> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let parse = match extension.as_str() {
        "stl" => stl::parse,
        "ply" => ply::parse,
        "obj" => obj::parse,
        _ => return Err(bad(path, "not a known surface file; supported are .stl, .ply and .obj")),
    };
    if !path.exists() {
        let source = std::io::Error::new(std::io::ErrorKind::NotFound, "no such file");
        return Err(Error::Io { path: path.into(), source });
    }
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let mut mesh = parse(&bytes).map_err(|reason| bad(path, reason))?;
    if mesh.triangles.is_empty() {
        return Err(bad(path, "the file has no triangles"));
    }
    if let Some(v) = mesh.vertices.iter().position(|v| !v.is_finite()) {
        return Err(bad(path, format!("vertex {v} is {}; coordinates must be finite", mesh.vertices[v])));
    }
    let count = mesh.vertices.len();
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
        let reason = format!("triangle {t} uses vertices {:?}, but there are only {count}", mesh.triangles[t]);
        return Err(bad(path, reason));
    }
    for v in &mut mesh.vertices {
        *v *= unit.metres();
    }
    Ok(mesh)
}

/// What a parser found, or why it could not: the path is added by its caller.
type Parsed<T> = std::result::Result<T, String>;

/// An [`Error::Parse`]. Some parsers break their messages into lines; ours are one.
fn bad(path: &Path, reason: impl Into<String>) -> Error {
    let reason: String = reason.into();
    Error::Parse { path: path.into(), reason: reason.split_whitespace().collect::<Vec<_>>().join(" ") }
}

/// Writes a whole file.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.into(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_surfaces_are_named() {
        let message = read_surface(Path::new("organ.step"), Unit::Metre).unwrap_err().to_string();
        assert!(message.contains("organ.step") && message.contains(".stl, .ply and .obj"), "{message}");
        assert!(matches!(read_surface(Path::new("absent.stl"), Unit::Metre), Err(Error::Io { .. })));
    }
}
