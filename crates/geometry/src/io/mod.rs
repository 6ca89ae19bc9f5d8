//! Mesh files.

mod file;
mod msh;
mod obj;
mod ply;
mod stl;

pub use msh::{read_msh, read_msh_groups, write_msh};
pub use ply::write_ply;

use crate::{Result, TriMesh};
use file::{bad, read};
use std::path::Path;

/// Unit of length of a file that does not state one.
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
    /// Length of the unit (m).
    pub fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 1e-3,
            Self::Centimetre => 1e-2,
            Self::Metre => 1.0,
        }
    }
}

/// Reads a surface from `.stl` (binary or text), `.ply` (with vertex colours, if present) or
/// `.obj`, converted to metres. The vertices are those of the file. In an STL file every triangle
/// has its own; [`repair`](crate::repair) merges them.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) if the file cannot be read.
/// [`Error::Parse`](crate::Error::Parse) for another extension, damaged or truncated content, an
/// index out of range, a vertex that is not finite, or no triangles.
///
/// ```
/// use trocar_geometry::io::{Unit, read_surface};
///
/// let path = std::env::temp_dir().join("trocar-read-surface.obj");
/// std::fs::write(&path, "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n")?;
/// let surface = read_surface(&path, Unit::Millimetre)?;
/// assert!((surface.area() - 5e-5).abs() < 1e-15);
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_surface(path: &Path, unit: Unit) -> Result<TriMesh> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let parse = match extension.as_str() {
        "stl" => stl::parse,
        "ply" => ply::parse,
        "obj" => obj::parse,
        _ => return Err(bad(path, "the extension must be .stl, .ply or .obj")),
    };
    let mut mesh = parse(&read(path)?).map_err(|reason| bad(path, reason))?;
    if mesh.triangles.is_empty() {
        return Err(bad(path, "the file has no triangles; a surface needs at least one"));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn unknown_and_missing_files_are_named() {
        let message = read_surface(Path::new("organ.step"), Unit::Metre).unwrap_err().to_string();
        assert!(message.contains("organ.step") && message.contains(".stl, .ply or .obj"), "{message}");
        assert!(matches!(read_surface(Path::new("absent.stl"), Unit::Metre), Err(Error::Io { .. })));
    }
}
