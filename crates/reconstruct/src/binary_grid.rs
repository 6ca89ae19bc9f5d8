//! The paper's own way to a surface, for comparison: occupancy on a binary grid (paper section III).
//!
//! Voxels between front and back are marked, closed morphologically, and enclosed by marching cubes at 0.5. Half a cell of
//! outward bias and filled concavities come with it (paper section VII-A); [`crate::resample`] has neither.

use glam::DVec3;
use trocar_camera::{Camera, Mask};
use trocar_geometry::{Grid, TriMesh, isosurface};

/// Edge of a voxel (paper) [m].
const VOXEL: f64 = 1.5e-3;

/// The surface of the voxels between `front` and `front` + `h` (depths along z, a value a pixel of `mask`) [m] inside `bounds`.
pub fn binary_grid(front: &[f64], h: &[f64], mask: &Mask, camera: &Camera, bounds: (DVec3, DVec3)) -> TriMesh {
    let mut grid = Grid::covering(bounds, VOXEL);
    let occupied = |p: DVec3| {
        let Some(pixel) = camera.project(p).map(|q| q.round()) else { return false };
        let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < mask.width as f64 && pixel.y < mask.height as f64;
        let i = if inside { pixel.y as usize * mask.width + pixel.x as usize } else { return false };
        mask.set[i] && (front[i]..=front[i] + h[i]).contains(&p.z)
    };
    let [nx, ny, nz] = grid.dims;
    let indices = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
    let marked: Vec<bool> = indices.map(|ijk| occupied(grid.point(ijk))).collect();
    let closed = eroded(&dilated(&marked, grid.dims), grid.dims);
    grid.values = closed.into_iter().map(|set| if set { -0.5 } else { 0.5 }).collect();
    isosurface(&grid, 0.0)
}

/// Marked, or with a marked neighbour across a face.
fn dilated(marked: &[bool], dims: [usize; 3]) -> Vec<bool> {
    (0..marked.len()).map(|i| marked[i] || neighbours(i, dims).any(|j| marked[j])).collect()
}

/// Marked, and all neighbours across faces too.
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

    /// A slab that faces the camera, its front between two layers of voxels: the binary surface is too near by up to a voxel.
    #[test]
    fn a_slab_keeps_its_size_to_a_voxel() {
        let camera = Camera { width: 80, height: 60, fx: 100.0, fy: 100.0, cx: 39.5, cy: 29.5, ..Camera::d405() };
        let mut mask = Mask::new(80, 60);
        for v in 15..45 {
            mask.set[v * 80 + 20..v * 80 + 60].fill(true);
        }
        let (front, h) = (vec![0.3; 4800], vec![0.012; 4800]);
        let (low, high) = (DVec3::new(-0.07, -0.05, 0.298), DVec3::new(0.07, 0.05, 0.314));
        let mesh = binary_grid(&front, &h, &mask, &camera, (low, high));
        let (low, high) = mesh.bounds().unwrap();
        assert!(mesh.is_watertight());
        assert!((low.z - 0.3).abs() < VOXEL && (high.z - 0.312).abs() < VOXEL, "{low} to {high}");
        let ratio = mesh.volume() / (0.012 * 0.12 * 0.09 * 1.04);
        assert!((0.8..1.2).contains(&ratio), "{ratio}");
    }
}
