//! A scalar field sampled on a regular grid.

use crate::SignedDistance;
use glam::DVec3;
use rayon::prelude::*;

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

/// Points along a block's edge.
const BLOCK: usize = 8;

/// Blocks are sampled point by point when the surface may come within this many spacings of them.
const BAND: f64 = 2.0;

/// Samples a signed distance on a grid of `spacing` [m] that covers `bounds` with two cells to spare on every side.
///
/// Values within two spacings of the surface are the field's own. Farther away, where a block of points is known from its middle to
/// lie on one side, they only have the right sign and are at least the band: a distance is 1-Lipschitz.
pub fn sample_distance(field: &(impl SignedDistance + ?Sized), bounds: (DVec3, DVec3), spacing: f64) -> Grid {
    let origin = bounds.0 - 2.0 * spacing;
    let cells = ((bounds.1 - bounds.0) / spacing).ceil();
    let dims = [cells.x, cells.y, cells.z].map(|c| c as usize + 5);
    let mut values = vec![0.0f32; dims.iter().product()];
    let layer = dims[0] * dims[1];
    let half = 0.5 * (BLOCK - 1) as f64;
    let reach = (half * 3f64.sqrt() + BAND) * spacing;
    values.par_chunks_mut(layer * BLOCK).enumerate().for_each(|(bk, slab)| {
        let k0 = bk * BLOCK;
        for j0 in (0..dims[1]).step_by(BLOCK) {
            for i0 in (0..dims[0]).step_by(BLOCK) {
                let at = |i: usize, j: usize, k: usize| origin + spacing * DVec3::new(i as f64, j as f64, k as f64);
                let middle = field.distance(at(i0, j0, k0) + half * spacing);
                for k in 0..(slab.len() / layer).min(BLOCK) {
                    for j in j0..(j0 + BLOCK).min(dims[1]) {
                        for i in i0..(i0 + BLOCK).min(dims[0]) {
                            slab[k * layer + j * dims[0] + i] = if middle.abs() > reach {
                                (middle - middle.signum() * half * 3f64.sqrt() * spacing) as f32
                            } else {
                                field.distance(at(i, j, k0 + k)) as f32
                            };
                        }
                    }
                }
            }
        }
    });
    Grid { origin, spacing, dims, values }
}
