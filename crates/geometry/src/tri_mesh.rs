//! Triangle surfaces.

use glam::DVec3;

/// A triangle surface, optionally coloured per vertex. Outward normals follow the right-hand rule.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions [m].
    pub vertices: Vec<DVec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB colour per vertex; empty, or as long as `vertices`.
    pub colors: Vec<[u8; 3]>,
}

impl TriMesh {
    /// True when every edge is shared by exactly two triangles that run along it in opposite directions.
    pub fn is_watertight(&self) -> bool {
        todo!()
    }

    /// Enclosed volume [m3]; negative when the triangles face inward.
    pub fn volume(&self) -> f64 {
        todo!()
    }

    /// Smallest and largest coordinates [m]; `None` without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        todo!()
    }
}
