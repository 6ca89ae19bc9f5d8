//! STL surfaces, binary and text.

use super::file::Parsed;
use crate::TriMesh;
use glam::DVec3;
use std::io::Cursor;

/// Bytes before the first facet of a binary file: a free header and the number of facets.
const HEADER: usize = 84;
/// Bytes of a facet: normal, three corners, two spare bytes.
const FACET: usize = 50;

/// Reads an STL file. Every triangle has its own three vertices.
pub(super) fn parse(bytes: &[u8]) -> Parsed<TriMesh> {
    let promised = bytes.get(80..HEADER).map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let size = bytes.len() as u64;
    if let Some(facets) = promised
        && HEADER as u64 + facets * FACET as u64 == size
    {
        // Some programs start binary files with "solid", which the reader would interpret as text.
        // Clearing the free header avoids this.
        let mut binary = bytes.to_vec();
        binary[..80].fill(0);
        return collect(&binary);
    }
    let text_start = bytes.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(0);
    if let Some(body) = bytes[text_start..].strip_prefix(b"solid") {
        // The name is not needed, and the reader requires a space before it.
        let body = &body[body.iter().position(|&b| b == b'\n').unwrap_or(body.len())..];
        return collect(&[b"solid ", body].concat());
    }
    Err(match promised {
        Some(facets) => format!(
            "a binary STL file of {facets} facets, as its header states, has {} bytes; this one has {size}",
            HEADER as u64 + facets * FACET as u64
        ),
        None => format!("an STL file has at least 84 bytes; this one has {size}"),
    })
}

fn collect(bytes: &[u8]) -> Parsed<TriMesh> {
    let mut cursor = Cursor::new(bytes);
    let facets = stl_io::create_stl_reader(&mut cursor).map_err(|e| e.to_string())?;
    let mut mesh = TriMesh::default();
    for (f, facet) in facets.enumerate() {
        let facet = facet.map_err(|e| format!("facet {f}: {}", plain(&e.to_string())))?;
        let first = u32::try_from(mesh.vertices.len()).map_err(|_| "too many facets".to_string())?;
        mesh.vertices.extend(facet.vertices.map(|v| DVec3::from_array(v.0.map(f64::from))));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    Ok(mesh)
}

/// The STL reader's message in plain words.
fn plain(message: &str) -> String {
    if let Some(rest) = message.strip_prefix("expected finite f32, got ") {
        let value = rest.split_whitespace().next().unwrap_or_default();
        return format!("a coordinate is {value}; it must be a finite number");
    }
    if let Some(found) = message.strip_prefix("vertex f32 f32 f32, got ") {
        return format!("a corner must be `vertex X Y Z`; the line has the words {found}");
    }
    message.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::cube;

    fn binary(mesh: &TriMesh) -> Vec<u8> {
        let facets: Vec<stl_io::Triangle> = (0..mesh.triangles.len())
            .map(|t| stl_io::Triangle {
                normal: stl_io::Normal::new([0.0; 3]),
                vertices: mesh.corners(t).map(|v| stl_io::Vertex::new(v.as_vec3().to_array())),
            })
            .collect();
        let mut bytes = Vec::new();
        stl_io::write_stl(&mut bytes, facets.iter()).unwrap();
        bytes
    }

    #[test]
    fn binary_files_are_read_whatever_their_header_says() {
        let mesh = cube(DVec3::ONE, 2.0);
        let mut bytes = binary(&mesh);
        for header in [b"\0\0\0\0\0 ", b"solid "] {
            bytes[..6].copy_from_slice(header);
            let read = parse(&bytes).unwrap();
            assert_eq!((read.vertices.len(), read.triangles.len()), (36, 12));
            assert!((read.volume() - 8.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_count_that_does_not_match_the_size_is_rejected() {
        let mut bytes = binary(&cube(DVec3::ONE, 2.0));
        bytes.pop();
        assert!(parse(&bytes).unwrap_err().contains("12 facets"));
        bytes[80..84].fill(0xff);
        assert!(parse(&bytes).unwrap_err().contains("4294967295 facets"));
        assert!(parse(&bytes[..50]).unwrap_err().contains("has 50"));
    }

    #[test]
    fn text_files_are_read_and_errors_name_the_facet() {
        let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
        for name in ["", " ", " liver", " my liver\r"] {
            let read = parse(format!("solid{name}\n{facet}{facet}endsolid{name}\n").as_bytes()).unwrap();
            assert_eq!(read.triangles.len(), 2);
            assert_eq!(read.vertices[4], DVec3::X);
        }
        assert!(parse(format!("solid\n{facet}facet normal 0").as_bytes()).unwrap_err().contains("facet 1"));
        assert!(parse(format!("solid\n{facet}").as_bytes()).is_err());
        let nan = facet.replace("vertex 1", "vertex nan");
        let reason = parse(format!("solid\n{facet}{nan}endsolid").as_bytes()).unwrap_err();
        assert_eq!(reason, "facet 1: a coordinate is NaN; it must be a finite number");
        let short = facet.replace("vertex 1 0 0", "vertex 1 0");
        let reason = parse(format!("solid\n{facet}{short}endsolid").as_bytes()).unwrap_err();
        assert!(reason.starts_with("facet 1: a corner must be `vertex X Y Z`"), "{reason}");
    }
}
