//! A scalar field sampled on a regular grid.

use crate::SignedDistance;
use glam::DVec3;

/// Values at the points `origin + spacing * (i, j, k)`, x fastest.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Position of point (0, 0, 0) [m].
    pub origin: DVec3,
    /// Distance between neighbouring points [m].
    pub spacing: f64,
    /// Number of points along x, y, z.
    pub dims: [usize; 3],
    /// One value a point, `dims[0] * dims[1] * dims[2]` of them.
    pub values: Vec<f32>,
}

/// Samples a signed distance on a grid of `spacing` [m] that covers `bounds` with two cells to spare on every side.
pub fn sample_distance(field: &impl SignedDistance, bounds: (DVec3, DVec3), spacing: f64) -> Grid {
    let _ = (field, bounds, spacing);
    todo!()
}
