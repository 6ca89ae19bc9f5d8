//! The surface where a grid's values cross a level.

use crate::{Grid, TriMesh};

/// Extracts the surface `value = level`; values below are inside. Watertight and manifold by construction wherever the
/// surface stays inside the grid.
pub fn isosurface(grid: &Grid, level: f32) -> TriMesh {
    let _ = (grid, level);
    todo!()
}
