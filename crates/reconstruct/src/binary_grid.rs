//! The paper's surface, for comparison: occupancy on a binary grid (paper section III).
//!
//! Voxels that a pixel's ray meets between front and back are marked, closed morphologically, and
//! enclosed by marching cubes at 0.5, half a cell beyond their centres. This gives half a cell of
//! outward bias and fills concavities (paper section VII-A); [`crate::resample`] does neither.

use glam::DVec3;
use trocar_camera::{Camera, Mask};
use trocar_geometry::{Grid, TriMesh, isosurface};

/// Edge of a voxel in the paper (m).
const VOXEL: f64 = 1.5e-3;

/// The surface of the voxels between `front` and `front` + `h` inside `bounds` (m). `front` and `h`
/// are depths along z, one per pixel of `mask`.
pub fn binary_grid(front: &[f64], h: &[f64], mask: &Mask, camera: &Camera, bounds: (DVec3, DVec3)) -> TriMesh {
    let mut grid = Grid::covering(bounds, VOXEL);
    let mut marked = vec![false; grid.values.len()];
    for i in (0..mask.set.len()).filter(|i| mask.set[*i]) {
        let ray = camera.ray((i % mask.width) as f64, (i / mask.width) as f64);
        let steps = (h[i] / (0.5 * VOXEL)).ceil().max(1.0);
        for step in 0..=steps as usize {
            let p = ray * (front[i] + h[i] * step as f64 / steps);
            let cell = ((p - grid.origin) / VOXEL).round();
            let ijk = cell.to_array().map(|c| c.max(0.0) as usize);
            if (0..3).all(|axis| ijk[axis] < grid.dims[axis]) {
                marked[grid.index(ijk)] = true;
            }
        }
    }
    let closed = eroded(&dilated(&marked, grid.dims), grid.dims);
    grid.values = closed.into_iter().map(|set| if set { -0.5 } else { 0.5 }).collect();
    isosurface(&grid, 0.0)
}

/// Dilation: marked, or with a marked neighbour across a face.
fn dilated(marked: &[bool], dims: [usize; 3]) -> Vec<bool> {
    (0..marked.len()).map(|i| marked[i] || neighbours(i, dims).any(|j| marked[j])).collect()
}

/// Erosion: marked, with all neighbours across faces.
fn eroded(marked: &[bool], dims: [usize; 3]) -> Vec<bool> {
    (0..marked.len()).map(|i| marked[i] && neighbours(i, dims).all(|j| marked[j])).collect()
}

fn neighbours(i: usize, [nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = usize> {
    let at = [i % nx, i / nx % ny, i / nx / ny];
    let strides = [1, nx, nx * ny];
    [nx, ny, nz].into_iter().zip(at).zip(strides).flat_map(move |((n, at), stride)| {
        [(at > 0).then(|| i - stride), (at + 1 < n).then_some(i + stride)].into_iter().flatten()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_fills_a_slot_and_keeps_a_box() {
        let dims = [9, 8, 7];
        let index = |i: usize, j: usize, k: usize| (k * 8 + j) * 9 + i;
        let mut marked = vec![false; 9 * 8 * 7];
        for k in 2..5 {
            for j in 2..6 {
                for i in 2..7 {
                    marked[index(i, j, k)] = true;
                }
            }
        }
        let whole = marked.clone();
        marked[index(4, 3, 3)] = false;
        assert_eq!(eroded(&dilated(&marked, dims), dims), whole);
    }

    /// A slab that faces the camera, seen with pixels finer than the voxels: on average half a
    /// voxel is added on every side.
    #[test]
    fn a_slab_grows_by_half_a_voxel() {
        let camera = Camera { width: 160, height: 120, fx: 400.0, fy: 400.0, cx: 79.5, cy: 59.5, ..Camera::d405() };
        let mut mask = Mask::new(160, 120);
        for v in 20..100 {
            mask.set[v * 160 + 30..v * 160 + 130].fill(true);
        }
        let mut grown = 0.0;
        const OFFSETS: usize = 10;
        for offset in 0..OFFSETS {
            let z = 0.3 + VOXEL * offset as f64 / OFFSETS as f64;
            let (front, h) = (vec![z; 160 * 120], vec![0.012; 160 * 120]);
            let bounds = (DVec3::new(-0.05, -0.05, 0.298), DVec3::new(0.05, 0.05, 0.316));
            let mesh = binary_grid(&front, &h, &mask, &camera, bounds);
            assert!(mesh.is_watertight());
            grown += (z - mesh.bounds().unwrap().0.z) / OFFSETS as f64;
        }
        assert!((grown / VOXEL - 0.5).abs() < 0.1, "{grown}");
    }
}
