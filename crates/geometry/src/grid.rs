//! A scalar field sampled on a regular grid.

use crate::SignedDistance;
use glam::DVec3;
use rayon::prelude::*;

/// Width of the band on either side of the surface in which [`sample_distance`] evaluates every
/// point (cells).
const BAND_CELLS: f64 = 3.0;
/// Points along the side of a block, the unit of the search in [`sample_distance`].
const BLOCK_POINTS: usize = 8;

/// Values at the points `origin + spacing * (i, j, k)`, x fastest.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Position of point (0, 0, 0) (m).
    pub origin: DVec3,
    /// Distance between neighbouring points (m).
    pub spacing: f64,
    /// Number of points along x, y, z.
    pub dims: [usize; 3],
    /// One value a point, `dims[0] * dims[1] * dims[2]` of them.
    pub values: Vec<f32>,
}

impl Grid {
    /// A grid of zeros with `spacing` (m) that covers `bounds` (m) and a margin of at least two
    /// cells on every side.
    pub fn covering(bounds: (DVec3, DVec3), spacing: f64) -> Self {
        let cells = ((bounds.1 - bounds.0).max(DVec3::ZERO) / spacing).ceil();
        let dims = [cells.x, cells.y, cells.z].map(|n| n as usize + 5);
        // The excess from rounding up is divided between the two sides.
        let origin = 0.5 * (bounds.0 + bounds.1) - 0.5 * spacing * (cells + 4.0);
        Self { origin, spacing, dims, values: vec![0.0; dims[0] * dims[1] * dims[2]] }
    }

    /// Position of point (i, j, k) (m).
    pub fn point(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        self.origin + self.spacing * DVec3::new(i as f64, j as f64, k as f64)
    }

    /// Index of point (i, j, k) in `values`.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }
}

/// Samples a signed distance on the grid [`Grid::covering`] gives.
///
/// Within three cells of the surface every value is that of the field. Farther away the value has
/// the correct sign and a magnitude of at least three cells and at most the true distance. A
/// distance changes by at most the distance moved. So a block of points whose centre is farther
/// from the surface than its corners (plus the band) cannot touch the surface, and gets this bound
/// instead. For a field that overestimates distances or jumps (a surface with holes wider than a
/// few cells) this does not hold; use [`sample_everywhere`] for it.
pub fn sample_distance(field: &(impl SignedDistance + ?Sized), bounds: (DVec3, DVec3), spacing: f64) -> Grid {
    let mut grid = Grid::covering(bounds, spacing);
    let blocks = grid.dims.map(|n| n.div_ceil(BLOCK_POINTS));
    let sampled: Vec<Vec<f32>> = (0..blocks[0] * blocks[1] * blocks[2])
        .into_par_iter()
        .map(|b| {
            let first = block_start(b, blocks);
            let mut values = vec![0.0; BLOCK_POINTS * BLOCK_POINTS * BLOCK_POINTS];
            sample_block(field, &grid, first, [0; 3], BLOCK_POINTS, &mut values);
            values
        })
        .collect();
    for (b, values) in sampled.iter().enumerate() {
        let [i, j, k] = block_start(b, blocks);
        let run = BLOCK_POINTS.min(grid.dims[0] - i);
        for dk in 0..BLOCK_POINTS.min(grid.dims[2] - k) {
            for dj in 0..BLOCK_POINTS.min(grid.dims[1] - j) {
                let to = grid.index([i, j + dj, k + dk]);
                let from = (dk * BLOCK_POINTS + dj) * BLOCK_POINTS;
                grid.values[to..to + run].copy_from_slice(&values[from..from + run]);
            }
        }
    }
    grid
}

/// Samples any field at every point of the grid [`Grid::covering`] gives.
pub fn sample_everywhere(field: &(impl SignedDistance + ?Sized), bounds: (DVec3, DVec3), spacing: f64) -> Grid {
    let mut grid = Grid::covering(bounds, spacing);
    let mut values = std::mem::take(&mut grid.values);
    values.par_chunks_mut(grid.dims[0]).enumerate().for_each(|(row, values)| {
        let (j, k) = (row % grid.dims[1], row / grid.dims[1]);
        for (i, value) in values.iter_mut().enumerate() {
            *value = field.distance(grid.point([i, j, k])) as f32;
        }
    });
    grid.values = values;
    grid
}

fn block_start(b: usize, blocks: [usize; 3]) -> [usize; 3] {
    [b % blocks[0] * BLOCK_POINTS, b / blocks[0] % blocks[1] * BLOCK_POINTS, b / (blocks[0] * blocks[1]) * BLOCK_POINTS]
}

/// Fills the cube of `size` points at `offset` in the block that starts at `first`. Subdivides it
/// where the surface may be near. It also writes points beyond the end of the grid, which are
/// dropped when the block is copied.
fn sample_block(
    field: &(impl SignedDistance + ?Sized),
    grid: &Grid,
    first: [usize; 3],
    offset: [usize; 3],
    size: usize,
    values: &mut [f32],
) {
    let start = [0, 1, 2].map(|a| first[a] + offset[a]);
    if (0..3).any(|a| start[a] >= grid.dims[a]) {
        return;
    }
    let place =
        |d: [usize; 3]| ((offset[2] + d[2]) * BLOCK_POINTS + offset[1] + d[1]) * BLOCK_POINTS + offset[0] + d[0];
    if size <= 2 {
        for c in 0..size * size * size {
            let d = [c % size, c / size % size, c / (size * size)];
            values[place(d)] = field.distance(grid.point([0, 1, 2].map(|a| start[a] + d[a]))) as f32;
        }
        return;
    }
    let half_side = 0.5 * (size - 1) as f64 * grid.spacing;
    let middle = grid.point(start) + half_side;
    let distance = field.distance(middle);
    if distance.abs() - half_side * 3f64.sqrt() >= BAND_CELLS * grid.spacing {
        for c in 0..size * size * size {
            let d = [c % size, c / size % size, c / (size * size)];
            let way = (grid.point([0, 1, 2].map(|a| start[a] + d[a])) - middle).length();
            values[place(d)] = ((distance.abs() - way) * distance.signum()) as f32;
        }
        return;
    }
    let half = size / 2;
    for c in 0..8 {
        let child = [offset[0] + (c & 1) * half, offset[1] + (c >> 1 & 1) * half, offset[2] + (c >> 2) * half];
        sample_block(field, grid, first, child, half, values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Torus;
    use std::sync::atomic::{AtomicUsize, Ordering};

    struct Counted<'a>(&'a Torus, AtomicUsize);

    impl SignedDistance for Counted<'_> {
        fn distance(&self, p: DVec3) -> f64 {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0.distance(p)
        }
    }

    #[test]
    fn near_values_are_exact_and_far_values_have_the_right_sign() {
        let torus = Torus(0.7, 0.25);
        let bounds = (DVec3::new(-0.95, -0.95, -0.25), DVec3::new(0.95, 0.95, 0.25));
        let h = 0.01;
        let counted = Counted(&torus, AtomicUsize::new(0));
        let grid = sample_distance(&counted, bounds, h);
        let truth = sample_everywhere(&torus, bounds, h);
        assert_eq!((grid.dims, grid.values.len()), (truth.dims, truth.values.len()));
        for (&value, &truth) in grid.values.iter().zip(&truth.values) {
            if f64::from(truth).abs() < BAND_CELLS * h {
                assert_eq!(value, truth);
            } else {
                assert!(value * truth > 0.0 && f64::from(value.abs()) > BAND_CELLS * h - 1e-6);
                assert!(value.abs() <= truth.abs() + 1e-6);
            }
        }
        assert!(counted.1.into_inner() * 2 < grid.values.len(), "the far field should be cheap");
    }

    #[test]
    fn the_margin_is_two_cells_on_every_side() {
        let (low, high) = (DVec3::new(0.0, 1.0, 2.0), DVec3::new(0.35, 1.0, 2.4));
        let grid = Grid::covering((low, high), 0.1);
        let last = grid.point(grid.dims.map(|n| n - 1));
        assert!((low - grid.origin).min_element() > 0.2 - 1e-9 && (last - high).min_element() > 0.2 - 1e-9);
        assert_eq!(grid.dims, [9, 5, 9]);
    }
}
