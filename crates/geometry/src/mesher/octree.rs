//! The octree of the graded lattice: cubes of cells that form one leaf.
//!
//! Leaves have edges of 1, 2, 4, ... cells and are aligned to multiples of their size. Leaves that
//! share a face, an edge or a corner differ by at most a factor of two. A lattice tet with a corner
//! on the surface or outside belongs to cells of the finest size only. So the angle bounds of a
//! uniform lattice hold there.

use super::bcc::Lattice;
use super::blocks::{At, BLOCK};
use super::points::Point;
use rayon::prelude::*;

/// Maximum level: leaves of 2^20 cells, more than any lattice has along an axis.
const MAX_LEVEL: u32 = 20;

/// The leaves over a lattice.
pub(super) struct Octree {
    /// For each level from 1, the cubes of 2^level cells that are not subdivided.
    whole: Vec<Bits>,
}

impl Octree {
    /// The coarsest tree with leaves of at most `coarsest` cells. `lattice` is warped.
    pub(super) fn over(lattice: &Lattice, coarsest: u32) -> Self {
        let mut whole: Vec<Bits> = Vec::new();
        let most = coarsest.max(1).ilog2().min(MAX_LEVEL);
        for level in 1..=most {
            let dims = lattice.blocks.count.map(|n| (n * BLOCK) >> level);
            let bits = match whole.last() {
                None => Bits::fill(dims, |pair| may_double(lattice, pair)),
                // All eight children and the cubes around them must be whole, so no neighbour is
                // smaller than half.
                Some(finer) => Bits::fill(dims, |cube| {
                    let low = cube.map(|c| 2 * c as i32 - 1);
                    (0..4).all(|z| (0..4).all(|y| (0..4).all(|x| finer.get([low[0] + x, low[1] + y, low[2] + z]))))
                }),
            };
            if !bits.any() {
                break;
            }
            whole.push(bits);
        }
        Self { whole }
    }

    /// Level of the leaf that contains a cell; its edge is 2^level cells. 0 outside the lattice.
    pub(super) fn level(&self, cell: [i32; 3]) -> u32 {
        let mut level = 0;
        for bits in &self.whole {
            if !bits.get(cell.map(|c| c >> (level + 1))) {
                break;
            }
            level += 1;
        }
        level
    }
}

/// Whether a cube of 2 x 2 x 2 cells may be one leaf: all corners of all its tets are inside.
fn may_double(lattice: &Lattice, pair: [usize; 3]) -> bool {
    let first = pair.map(|c| 2 * c);
    match lattice.blocks.block_at(lattice.blocks.block(first)) {
        At::Outside => false,
        At::Inside => true,
        At::Slot(_) => {
            // In half cells: the cube extends from 0 to 4.
            let first: Point = first.map(|c| 2 * c as i32);
            let inside = |x: i32, y: i32, z: i32| lattice.is_inside([first[0] + x, first[1] + y, first[2] + z]);
            let corners = [0, 2, 4];
            let centres = [1, 3];
            corners.iter().all(|&z| corners.iter().all(|&y| corners.iter().all(|&x| inside(x, y, z))))
                && centres.iter().all(|&u| {
                    centres.iter().all(|&v| {
                        // Within, and across the six faces.
                        [-1, 1, 3, 5].iter().all(|&w| inside(w, u, v) && inside(u, w, v) && inside(u, v, w))
                    })
                })
        }
    }
}

/// A set of cubes of a regular grid.
struct Bits {
    dims: [usize; 3],
    words: Vec<u64>,
}

impl Bits {
    /// The cubes for which `holds` is true.
    fn fill(dims: [usize; 3], holds: impl Fn([usize; 3]) -> bool + Sync) -> Self {
        let count: usize = dims.iter().product();
        let words = (0..count.div_ceil(64))
            .into_par_iter()
            .map(|word| {
                let all = 64 * word..count.min(64 * word + 64);
                all.fold(0, |bits, n| {
                    let at = [n % dims[0], n / dims[0] % dims[1], n / dims[0] / dims[1]];
                    bits | u64::from(holds(at)) << (n % 64)
                })
            })
            .collect();
        Self { dims, words }
    }

    /// Whether a cube is in the set. Cubes outside the grid are not.
    fn get(&self, at: [i32; 3]) -> bool {
        // A negative coordinate becomes a very large one.
        let [x, y, z] = at.map(|c| c as usize);
        let [nx, ny, nz] = self.dims;
        let n = (z.wrapping_mul(ny).wrapping_add(y)).wrapping_mul(nx).wrapping_add(x);
        x < nx && y < ny && z < nz && self.words[n / 64] >> (n % 64) & 1 == 1
    }

    fn any(&self) -> bool {
        self.words.iter().any(|&word| word != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Ball;
    use glam::DVec3;

    #[test]
    fn leaves_are_balanced_and_the_surface_is_finest() {
        let lattice = Lattice::sample(&Ball(1.0), (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.03).unwrap();
        let tree = Octree::over(&lattice, 1 << 30);
        let n = lattice.blocks.count.map(|n| (n * BLOCK) as i32);
        let mut cells = [0usize; 8];
        for z in 0..n[2] {
            for y in 0..n[1] {
                for x in 0..n[0] {
                    let level = tree.level([x, y, z]);
                    cells[level as usize] += 1;
                    for near in [[x + 1, y, z], [x, y + 1, z], [x, y, z + 1], [x + 1, y + 1, z], [x + 1, y + 1, z + 1]]
                    {
                        assert!(tree.level(near).abs_diff(level) <= 1);
                    }
                    if level > 0 {
                        for corner in 0..8 {
                            let at = [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)].map(|c| 2 * c);
                            assert!(lattice.is_inside(at));
                        }
                    }
                }
            }
        }
        assert!(cells[1] > 0 && cells[2] > 0 && cells[3] > 0);
        let limited = Octree::over(&lattice, 3);
        assert!(limited.whole.len() == 1 && Octree::over(&lattice, 1).whole.is_empty());
    }
}
