//! From a surface as found on disk to one that encloses a volume.

use crate::{Result, TriMesh};

/// What [`repair`] found and did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RepairReport {
    /// Coincident vertices merged (an STL file has none shared).
    pub merged_vertices: usize,
    /// Triangles without area or with a repeated vertex, removed.
    pub degenerate_triangles: usize,
    /// Edges with other than two triangles before the repair.
    pub open_edges: usize,
    /// Connected components found.
    pub components: usize,
    /// True when the surface was rebuilt from its winding number because it was not watertight.
    pub rebuilt: bool,
    /// True when the triangles faced inward and were turned.
    pub flipped: bool,
}

/// Makes `mesh` watertight and outward, or says why it cannot be. Merges vertices, drops degenerate triangles, turns an
/// inward surface; a surface that still is not watertight is rebuilt as the isosurface of its generalized winding number,
/// and its largest piece kept.
///
/// # Errors
/// NaN or infinite vertices, indices out of range, no triangles, or a surface that encloses no volume.
pub fn repair(mesh: &TriMesh) -> Result<(TriMesh, RepairReport)> {
    let _ = mesh;
    todo!()
}
