//! STL surfaces, binary and text.

use crate::TriMesh;
use glam::DVec3;
use std::io::Cursor;

const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// Parses an STL file; triangles keep vertices of their own.
pub(super) fn parse(bytes: &[u8]) -> Result<TriMesh, String> {
    let mut bytes = bytes.to_vec();
    let count = bytes.get(HEADER..HEADER + 4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]]) as usize);
    let is_binary = count.is_some_and(|n| n.checked_mul(TRIANGLE).is_some_and(|n| HEADER + 4 + n == bytes.len()));
    if is_binary {
        // Some programs begin a binary header with "solid", the mark of a text file.
        bytes[..HEADER].fill(0);
    } else if !bytes.trim_ascii_start().starts_with(b"solid") {
        return Err(format!(
            "neither text (no 'solid') nor whole binary STL: {} bytes, the header promises {}",
            bytes.len(),
            count.map_or("nothing".to_owned(), |n| format!(
                "{n} triangles, {} bytes",
                HEADER as u64 + 4 + n as u64 * 50
            ))
        ));
    }
    let mut cursor = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut cursor).map_err(|e| format!("unreadable STL: {e}"))?;
    let mut mesh = TriMesh::default();
    for triangle in reader {
        let triangle = triangle.map_err(|e| format!("unreadable STL: {e}"))?;
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(triangle.vertices.iter().map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    Ok(mesh)
}
