//! PLY surfaces with vertex colours.

use super::write;
use crate::{Result, TriMesh};
use glam::DVec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::io::Cursor;
use std::path::Path;

/// Parses a PLY file, text or binary; polygons become fans.
pub(super) fn parse(bytes: &[u8]) -> std::result::Result<TriMesh, String> {
    let unreadable = |e: &dyn std::fmt::Display| format!("unreadable PLY: {e}");
    let parser = Parser::<DefaultElement>::new();
    let header = parser.read_ply_header(&mut Cursor::new(bytes)).map_err(|e| unreadable(&e))?;
    // Every element takes at least a byte: a header that promises more than the file holds is refused before anything is allocated.
    if let Some((name, e)) = header.elements.iter().find(|(_, e)| e.count > bytes.len()) {
        return Err(format!("the header promises {} '{name}' elements in a file of {} bytes", e.count, bytes.len()));
    }
    let ply = parser.read_ply(&mut Cursor::new(bytes)).map_err(|e| unreadable(&e))?;
    let missing = |what: &str| format!("no {what} in it; a surface has vertex x y z and face vertex_indices");
    let mut mesh = TriMesh::default();
    for vertex in ply.payload.get("vertex").ok_or_else(|| missing("element 'vertex'"))? {
        let coordinate = |name: &str| vertex.get(name).and_then(number).ok_or_else(|| missing(name));
        mesh.vertices.push(DVec3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?));
        let channel = |name: &str| vertex.get(name).and_then(Property::to_u8_color_lossy);
        if let (Some(r), Some(g), Some(b)) = (channel("red"), channel("green"), channel("blue")) {
            mesh.colors.push([r, g, b]);
        }
    }
    if mesh.colors.len() != mesh.vertices.len() {
        mesh.colors.clear();
    }
    for face in ply.payload.get("face").ok_or_else(|| missing("element 'face'"))? {
        let corners = face.get("vertex_indices").or_else(|| face.get("vertex_index")).and_then(Property::to_u32_list);
        let corners = corners.ok_or_else(|| missing("vertex_indices"))?;
        if let [first, rest @ ..] = corners.as_slice() {
            mesh.triangles.extend(rest.windows(2).map(|w| [*first, w[0], w[1]]));
        }
    }
    Ok(mesh)
}

fn number(property: &Property) -> Option<f64> {
    match property {
        Property::Double(v) => Some(*v),
        other => other.to_f32_lossy().map(f64::from),
    }
}

/// Writes a binary little-endian `.ply` in metres, with vertex colours when the mesh has them.
///
/// # Errors
/// Names the file when it cannot be written.
pub fn write_ply(path: &Path, mesh: &TriMesh) -> Result<()> {
    let colored = mesh.colors.len() == mesh.vertices.len() && !mesh.colors.is_empty();
    let colors = if colored { "property uchar red\nproperty uchar green\nproperty uchar blue\n" } else { "" };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment lengths in metres\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\n{colors}element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for (i, v) in mesh.vertices.iter().enumerate() {
        bytes.extend(v.to_array().iter().flat_map(|x| x.to_le_bytes()));
        if colored {
            bytes.extend(mesh.colors[i]);
        }
    }
    for t in &mesh.triangles {
        bytes.push(3);
        bytes.extend(t.iter().flat_map(|i| i.to_le_bytes()));
    }
    write(path, &bytes)
}
