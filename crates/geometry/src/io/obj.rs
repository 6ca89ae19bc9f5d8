//! Wavefront OBJ surfaces (geometry only).

use crate::TriMesh;
use glam::DVec3;
use std::io::Cursor;

/// Parses an OBJ file; all its objects become one surface, polygons become fans.
pub(super) fn parse(bytes: &[u8]) -> Result<TriMesh, String> {
    let options = tobj::LoadOptions { triangulate: true, single_index: false, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|e| format!("unreadable OBJ: {e}"))?;
    let mut mesh = TriMesh::default();
    for model in models {
        let first = mesh.vertices.len() as u32;
        let positions = model.mesh.positions.chunks_exact(3);
        mesh.vertices.extend(positions.map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into())));
        let triangles = model.mesh.indices.chunks_exact(3);
        mesh.triangles.extend(triangles.map(|t| [first + t[0], first + t[1], first + t[2]]));
    }
    Ok(mesh)
}
