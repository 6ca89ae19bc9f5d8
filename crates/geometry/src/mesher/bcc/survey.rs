//! The search for the blocks of the lattice that the surface may cross.

use super::{At, BLOCK, BLOCK_POINTS, INSIDE, Lattice, MapWith, OUTSIDE, Point, STEEPEST, STEPS};
use crate::{Error, SignedDistance};
use glam::DVec3;
use rayon::prelude::*;

/// Blocks along the edge of a tile, the unit in which the space is searched for the surface.
const TILE: usize = 8;
/// Cells around a block in which the surface must not lie for the block to count as wholly inside or outside. Then none
/// of its points is moved, and none has a neighbour on the other side.
const CLEAR: f64 = 2.0;
/// A block not yet known to lie wholly inside or outside.
const UNKNOWN: u32 = u32::MAX - 2;

impl Lattice {
    /// Fills the table of blocks.
    pub(super) fn classify(&mut self, shape: &dyn SignedDistance) {
        let tiles = self.blocks.map(|n| n.div_ceil(TILE));
        let found: Vec<Vec<(usize, u32)>> = (0..tiles.iter().product())
            .into_par_iter()
            .map(|tile: usize| {
                let first = [tile % tiles[0], tile / tiles[0] % tiles[1], tile / tiles[0] / tiles[1]];
                let mut known = Vec::new();
                self.classify_cube(shape, first.map(|t| t * TILE), TILE, &mut known);
                known
            })
            .collect();
        self.stored = vec![UNKNOWN; self.blocks.iter().product()];
        for (block, kind) in found.into_iter().flatten() {
            self.stored[block] = kind;
        }
        for (block, kind) in self.stored.iter_mut().enumerate().filter(|(_, kind)| **kind == UNKNOWN) {
            *kind = self.block_of.len() as u32;
            self.block_of.push(block as u32);
        }
    }

    /// Lists the blocks of the cube of `size` blocks at block `first` that are wholly inside or outside.
    fn classify_cube(&self, shape: &dyn SignedDistance, first: [usize; 3], size: usize, known: &mut Vec<(usize, u32)>) {
        if (0..3).any(|a| first[a] >= self.blocks[a]) {
            return;
        }
        let (distance, reach) = self.probe(shape, first.map(|b| b * BLOCK), size * BLOCK);
        if distance.abs() > reach + CLEAR * STEEPEST * self.cell {
            let kind = if distance > 0.0 { OUTSIDE } else { INSIDE };
            let ends = first.map_with(self.blocks, |b, n| (b + size).min(n));
            for z in first[2]..ends[2] {
                for y in first[1]..ends[1] {
                    let row = (z * self.blocks[1] + y) * self.blocks[0];
                    known.extend((first[0]..ends[0]).map(|x| (row + x, kind)));
                }
            }
        } else if size > 1 {
            for octant in 0..8 {
                let offset = [octant & 1, octant >> 1 & 1, octant >> 2].map(|bit| bit * (size / 2));
                self.classify_cube(shape, first.map_with(offset, |a, b| a + b), size / 2, known);
            }
        }
    }

    /// A place where the inside of the shape meets blocks that are outside, or the rim, without a surface between: the
    /// field jumps or the bounds are too narrow.
    pub(super) fn jump(&self) -> Option<DVec3> {
        (0..self.stored.len()).into_par_iter().filter(|&block| self.stored[block] != OUTSIDE).find_map_first(|block| {
            let first = self.first_cell(block);
            let position = |p: Point| self.position(p);
            if self.stored[block] == INSIDE {
                let clash = (0..27).any(|n: i32| {
                    let offset = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                    self.at(first.map_with(offset, |c, o| 2 * (c as i32 + o * BLOCK as i32))) == At::Outside
                });
                return clash.then(|| position(first.map(|c| (2 * c + BLOCK) as i32)));
            }
            let slots = self.stored[block] * BLOCK_POINTS as u32;
            let rim = |c: i32| c % (2 * BLOCK as i32) < 2 || c % (2 * BLOCK as i32) > 2 * BLOCK as i32 - 3;
            (slots..slots + BLOCK_POINTS as u32).map(|slot| (slot, self.point(slot))).find_map(|(slot, p)| {
                let inside = self.values[slot as usize] < 0.0;
                let wrong = if inside { At::Outside } else { At::Inside };
                let clash = p.iter().any(|&c| rim(c))
                    && (0..STEPS.len()).any(|step| self.at(Self::neighbour(p, step)) == wrong);
                clash.then(|| position(p))
            })
        })
    }
}

/// The complaint about a field whose sign changes where it promised none.
pub(in crate::mesher) fn jumps(at: DVec3) -> Error {
    Error::Mesh(format!(
        "the shape has an inside at {at} m, beyond its bounds or where its signed distance promised none; widen the \
         bounds, or use a field that changes no faster than the position"
    ))
}
