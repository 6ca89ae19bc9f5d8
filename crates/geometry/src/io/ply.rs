//! Stanford PLY surfaces.

use super::file::{Parsed, write};
use crate::{Result, TriMesh};
use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult};
use std::io::Cursor;
use std::path::Path;

/// An element of the file, with what is used of it: a vertex has a place and a colour, a face has
/// corners. One type for all, because the parser is compiled anew for each.
#[derive(Default)]
struct Element {
    position: DVec3,
    color: [u8; 3],
    /// `None` if they are not a list of non-negative integers.
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        if is_corner_list(key) {
            self.corners = property.to_u32_list();
            return PropertyAccessResult::Set;
        }
        let color = property.to_u8_color_lossy();
        match (key, number(&property), color) {
            ("x", Some(x), _) => self.position.x = x,
            ("y", Some(y), _) => self.position.y = y,
            ("z", Some(z), _) => self.position.z = z,
            ("red" | "diffuse_red", _, Some(c)) => self.color[0] = c,
            ("green" | "diffuse_green", _, Some(c)) => self.color[1] = c,
            ("blue" | "diffuse_blue", _, Some(c)) => self.color[2] = c,
            _ => {}
        }
        PropertyAccessResult::Set
    }
}

fn is_corner_list(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

fn number(property: &Property) -> Option<f64> {
    match *property {
        Property::Double(x) => Some(x),
        Property::Int(x) => Some(f64::from(x)),
        Property::UInt(x) => Some(f64::from(x)),
        ref other => other.to_f32_lossy().map(f64::from),
    }
}

/// Reads vertices, their colours (if present) and faces. Polygons become fans of triangles.
pub(super) fn parse(bytes: &[u8]) -> Parsed<TriMesh> {
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = Parser::<Element>::new().read_header(&mut reader).map_err(|e| e.to_string())?;
    check(&header, bytes.len())?;
    let mut mesh = TriMesh::default();
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                let vertices = read(&mut reader, element, &header)?;
                mesh.vertices = vertices.iter().map(|v| v.position).collect();
                if has(element, &["red", "diffuse_red"]) {
                    mesh.colors = vertices.iter().map(|v| v.color).collect();
                }
            }
            "face" => {
                for (f, face) in read(&mut reader, element, &header)?.iter().enumerate() {
                    let corners = face.corners.as_deref().unwrap_or_default();
                    if corners.len() < 3 {
                        return Err(format!("face {f} must list at least three non-negative vertex indices"));
                    }
                    mesh.triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
                }
            }
            _ => {
                read(&mut reader, element, &header)?;
            }
        }
    }
    Ok(mesh)
}

/// Rejects a header that states more elements than `size` bytes can contain, or lacks what a
/// surface needs.
fn check(header: &Header, size: usize) -> Parsed<()> {
    for element in header.elements.values() {
        let (name, count) = (&element.name, element.count);
        // Every element has at least one byte.
        if count > size || (count > 0 && element.properties.is_empty()) {
            return Err(format!(
                "the header states {count} elements {name:?}, more than the file's {size} bytes can contain"
            ));
        }
    }
    let vertex = header.elements.get("vertex").ok_or("the header has no element \"vertex\"")?;
    let face = header.elements.get("face").ok_or("the header has no element \"face\"; a surface needs one")?;
    if !["x", "y", "z"].iter().all(|&name| has(vertex, &[name])) {
        return Err("the element \"vertex\" must have the properties x, y and z".into());
    }
    if !face.properties.keys().any(|name| is_corner_list(name)) {
        return Err("the element \"face\" must have the list property vertex_indices".into());
    }
    Ok(())
}

fn has(element: &ElementDef, names: &[&str]) -> bool {
    names.iter().any(|&name| element.properties.contains_key(name))
}

fn read(reader: &mut Reader<Cursor<&[u8]>>, element: &ElementDef, header: &Header) -> Parsed<Vec<Element>> {
    Parser::new().read_payload_for_element(reader, element, header).map_err(|e| e.to_string())
}

/// Writes a binary little-endian `.ply` in metres (coordinates as `double`), with vertex colours if
/// the mesh has them.
///
/// # Errors
/// [`crate::Error::Io`] if the file cannot be written.
pub fn write_ply(path: &Path, mesh: &TriMesh) -> Result<()> {
    let colored = mesh.colors.len() == mesh.vertices.len() && !mesh.colors.is_empty();
    let colors = if colored { "property uchar red\nproperty uchar green\nproperty uchar blue\n" } else { "" };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment lengths in metres\nelement vertex {}\nproperty double x\n\
         property double y\nproperty double z\n{colors}element face {}\nproperty list uchar int vertex_indices\n\
         end_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for (v, position) in mesh.vertices.iter().enumerate() {
        bytes.extend(position.to_array().iter().flat_map(|x| x.to_le_bytes()));
        if colored {
            bytes.extend(mesh.colors[v]);
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|v| v.to_le_bytes()));
    }
    write(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Unit, read_surface};
    use crate::shapes::icosphere;

    #[test]
    fn a_colored_surface_is_read_back_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("organ.ply");
        let mut mesh = icosphere(2, 0.1);
        for colors in [Vec::new(), (0..mesh.vertices.len()).map(|v| [v as u8, 7, 255 - v as u8]).collect()] {
            mesh.colors = colors;
            write_ply(&path, &mesh).unwrap();
            assert_eq!(read_surface(&path, Unit::Metre).unwrap(), mesh);
        }
        let small = read_surface(&path, Unit::Millimetre).unwrap();
        assert!((small.vertices[0].x - 1e-4).abs() < 1e-18);
    }

    #[test]
    fn text_with_polygons_and_other_elements_is_read() {
        let text = "ply\nformat ascii 1.0\nelement camera 1\nproperty float f\nelement vertex 4\nproperty float x\n\
            property float y\nproperty float z\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n\
            3.5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
        let mesh = parse(text.as_bytes()).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert!((mesh.area() - 1.0).abs() < 1e-12);
        let rejected = |from: &str, to: &str, why: &str| {
            let message = parse(text.replace(from, to).as_bytes()).unwrap_err();
            assert!(message.contains(why), "{message}");
        };
        rejected("vertex 4", "vertex 99999999999", "99999999999");
        rejected("property float z\n", "", "x, y and z");
        rejected("4 0 1 2 3", "2 0 1", "face 0");
        rejected("4 0 1 2 3\n", "", "face");
        rejected("property float f\n", "", "camera");
    }
}
