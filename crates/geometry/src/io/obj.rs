//! Wavefront OBJ surfaces, without materials.

use super::file::Parsed;
use crate::TriMesh;
use glam::DVec3;

/// Reads all objects of the file as one surface. Polygons become fans of triangles. Colours are not
/// read.
pub(super) fn parse(bytes: &[u8]) -> Parsed<TriMesh> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let (models, _) =
        tobj::load_obj_buf(&mut std::io::Cursor::new(bytes), &options, no_materials).map_err(|e| e.to_string())?;
    let mut mesh = TriMesh::default();
    for model in models {
        let first = u32::try_from(mesh.vertices.len()).map_err(|_| "too many vertices".to_string())?;
        let positions = model.mesh.positions.as_chunks::<3>().0;
        mesh.vertices.extend(positions.iter().map(|&p| DVec3::from_array(p.map(f64::from))));
        for &triangle in model.mesh.indices.as_chunks::<3>().0 {
            mesh.triangles.push(triangle.map(|v| v.saturating_add(first)));
        }
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::cube;
    use std::fmt::Write;

    fn text(mesh: &TriMesh) -> String {
        let mut text = String::from("mtllib absent.mtl\no organ\n");
        for v in &mesh.vertices {
            writeln!(text, "v {} {} {}", v.x, v.y, v.z).unwrap();
        }
        for t in &mesh.triangles {
            writeln!(text, "f {}//1 {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap();
        }
        text.replace("//1", "")
    }

    #[test]
    fn a_cube_is_read() {
        let mesh = cube(DVec3::ZERO, 2.0);
        let read = parse(text(&mesh).as_bytes()).unwrap();
        assert!(read.is_watertight());
        assert!((read.volume() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn polygons_become_fans_and_objects_one_surface() {
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\no first\nf 1 2 3 4\no second\nf -4 -3 -2\nl 1 2\n";
        let read = parse(square.as_bytes()).unwrap();
        assert_eq!(read.triangles.len(), 3);
        assert!((read.area() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn damaged_files_are_rejected() {
        for text in ["v 0 zero 0\n", "v 0 0 0\nf 1 2 9\n", "f 1 2 3\n", "v 0 0\nf 1 1 1\n"] {
            assert!(parse(text.as_bytes()).is_err(), "{text}");
        }
    }
}
