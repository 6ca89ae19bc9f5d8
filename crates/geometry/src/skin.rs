//! A fine surface carried by a coarse tetrahedral body.

use crate::{TetMesh, TriMesh};
use glam::DVec3;

/// Barycentric attachment of surface vertices to the elements that hold (or are nearest to) them.
#[derive(Clone, Debug)]
pub struct Skin {
    /// For each surface vertex: element and four weights that sum to 1.
    pub bindings: Vec<(u32, [f64; 4])>,
}

impl Skin {
    /// Binds each vertex of `surface` to `body` in the rest shape.
    pub fn bind(surface: &TriMesh, body: &TetMesh) -> Self {
        let _ = (surface, body);
        todo!()
    }

    /// Surface vertex positions when the body's nodes are at `nodes` [m], written to `out`.
    pub fn deform(&self, body: &TetMesh, nodes: &[DVec3], out: &mut [DVec3]) {
        let _ = (body, nodes, out);
        todo!()
    }
}
