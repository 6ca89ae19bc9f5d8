//! Blocks of the lattice, and the search for those that the surface may cross.
//!
//! Only blocks near the surface are stored. All others lie entirely inside or outside.

use super::points::{LONG_STEPS, MapWith, Point};
use crate::{Error, Result, SignedDistance};
use glam::DVec3;
use rayon::prelude::*;

/// Cells along the edge of a block, the unit of storage.
pub(super) const BLOCK: usize = 8;
/// Points of a block: the lower corner and the centre of each of its cells.
pub(super) const BLOCK_POINTS: usize = 2 * BLOCK * BLOCK * BLOCK;
/// Cells between the bounds of the shape and the boundary of the lattice.
const MARGIN: f64 = 2.0;
/// Maximum number of blocks of a lattice, stored or not.
const MAX_BLOCKS: f64 = (1 << 23) as f64;
/// Maximum number of stored points. With at most 14 cut points each, 32 bits number all of them.
const MAX_SLOTS: usize = 1 << 26;
/// Maximum slope of the field. A distance has slope 1; estimates of a distance may be this steep.
const MAX_SLOPE: f64 = 1.25;
/// Blocks along the edge of a tile, the unit of the search for the surface.
const TILE: usize = 8;
/// Cells around a block that the surface must not cross for the block to count as entirely inside
/// or outside. Then none of its points is moved, and none has a neighbour on the other side.
const CLEARANCE_CELLS: f64 = 2.0;

/// Entries of the table of blocks that are not numbers of stored blocks.
const OUTSIDE: u32 = u32::MAX;
const INSIDE: u32 = u32::MAX - 1;
const UNKNOWN: u32 = u32::MAX - 2;

/// Location of a lattice point or block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum At {
    /// In a block far outside the surface, or beyond the lattice.
    Outside,
    /// In a block far inside the surface.
    Inside,
    /// Near the surface: the index of the point, or of the first point of the block, in storage.
    Slot(u32),
}

/// The blocks of a lattice over a box. A *slot* is the storage index of a point.
pub(super) struct Blocks {
    origin: DVec3,
    /// Edge of the cubic cell (m).
    pub(super) cell: f64,
    /// Number of blocks along each axis.
    pub(super) count: [usize; 3],
    /// For each block, its number among the stored blocks, or `OUTSIDE` or `INSIDE`.
    state: Vec<u32>,
    /// For each stored block, its number among all blocks, ascending.
    stored: Vec<u32>,
}

impl Blocks {
    /// Covers `bounds` (m) with cells of edge `cell` (m) and finds the blocks near the surface of
    /// `shape`.
    pub(super) fn find(shape: &dyn SignedDistance, bounds: (DVec3, DVec3), cell: f64) -> Result<Self> {
        let (lo, hi) = bounds;
        if !(cell > 0.0 && cell.is_finite()) {
            return Err(Error::Mesh(format!("the lattice cell is {cell} m; it must be a positive length")));
        }
        if !(lo.is_finite() && hi.is_finite() && lo.cmple(hi).all()) {
            return Err(Error::Mesh(format!("the bounds {lo} to {hi} m are not a box of finite size")));
        }
        let cells = ((hi - lo) / cell).ceil() + 2.0 * MARGIN;
        let blocks = (cells / BLOCK as f64).ceil();
        let too_fine = || {
            let size = hi - lo;
            Error::Mesh(format!("a cell of {cell} m is too fine for a shape of {size} m; use a larger one"))
        };
        if blocks.element_product() > MAX_BLOCKS {
            return Err(too_fine());
        }
        let origin = 0.5 * (lo + hi) - 0.5 * cell * BLOCK as f64 * blocks;
        let count = blocks.to_array().map(|n| n as usize);
        let mut blocks = Self { origin, cell, count, state: Vec::new(), stored: Vec::new() };
        blocks.classify(shape);
        if blocks.stored.len() > MAX_SLOTS / BLOCK_POINTS { Err(too_fine()) } else { Ok(blocks) }
    }

    /// Fills the table of blocks.
    fn classify(&mut self, shape: &dyn SignedDistance) {
        let tiles = self.count.map(|n| n.div_ceil(TILE));
        let found: Vec<Vec<(usize, u32)>> = (0..tiles.iter().product())
            .into_par_iter()
            .map(|tile: usize| {
                let first = [tile % tiles[0], tile / tiles[0] % tiles[1], tile / tiles[0] / tiles[1]];
                let mut known = Vec::new();
                self.classify_cube(shape, first.map(|t| t * TILE), TILE, &mut known);
                known
            })
            .collect();
        self.state = vec![UNKNOWN; self.count.iter().product()];
        for (block, kind) in found.into_iter().flatten() {
            self.state[block] = kind;
        }
        for (block, kind) in self.state.iter_mut().enumerate().filter(|(_, kind)| **kind == UNKNOWN) {
            *kind = self.stored.len() as u32;
            self.stored.push(block as u32);
        }
    }

    /// Lists the blocks in the cube of `size` blocks at block `first` that are entirely inside or
    /// outside.
    fn classify_cube(&self, shape: &dyn SignedDistance, first: [usize; 3], size: usize, known: &mut Vec<(usize, u32)>) {
        if (0..3).any(|a| first[a] >= self.count[a]) {
            return;
        }
        let (distance, reach) = self.probe(shape, first.map(|b| b * BLOCK), size * BLOCK);
        if distance.abs() > reach + CLEARANCE_CELLS * MAX_SLOPE * self.cell {
            let kind = if distance > 0.0 { OUTSIDE } else { INSIDE };
            let ends = first.map_with(self.count, |b, n| (b + size).min(n));
            for z in first[2]..ends[2] {
                for y in first[1]..ends[1] {
                    let row = (z * self.count[1] + y) * self.count[0];
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

    /// Position of a point (m).
    pub(super) fn position(&self, p: Point) -> DVec3 {
        self.origin + 0.5 * self.cell * DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
    }

    /// Length of a step (m).
    pub(super) fn step_length(&self, step: usize) -> f64 {
        if step < LONG_STEPS { self.cell } else { self.cell * 0.75f64.sqrt() }
    }

    /// The point at a slot.
    pub(super) fn point(&self, slot: u32) -> Point {
        let local = slot as usize % BLOCK_POINTS;
        let first = self.first_cell(self.stored[slot as usize / BLOCK_POINTS] as usize);
        let (x, y, z) = (local / 2 % BLOCK, local / 2 / BLOCK % BLOCK, local / 2 / BLOCK / BLOCK);
        [x, y, z].map_with(first, |inside, first| (2 * (first + inside) + local % 2) as i32)
    }

    /// Location of a point.
    pub(super) fn at(&self, p: Point) -> At {
        let cell = p.map(|c| (c >> 1) as usize);
        // A negative coordinate became a very large one.
        if (0..3).any(|a| cell[a] >= self.count[a] * BLOCK) {
            return At::Outside;
        }
        match self.state[self.block(cell)] {
            OUTSIDE => At::Outside,
            INSIDE => At::Inside,
            stored => At::Slot(stored * BLOCK_POINTS as u32 + Self::local(p) as u32),
        }
    }

    /// The slot of a point; `None` if it is far from the surface or beyond the lattice.
    pub(super) fn slot(&self, p: Point) -> Option<u32> {
        match self.at(p) {
            At::Slot(slot) => Some(slot),
            _ => None,
        }
    }

    /// Number of a point within its block.
    pub(super) fn local(p: Point) -> usize {
        let [x, y, z] = p.map(|c| (c >> 1) as usize % BLOCK);
        2 * ((z * BLOCK + y) * BLOCK + x) + (p[0] & 1) as usize
    }

    /// Number of the block that contains a cell.
    pub(super) fn block(&self, cell: [usize; 3]) -> usize {
        let [x, y, z] = cell.map(|c| c / BLOCK);
        (z * self.count[1] + y) * self.count[0] + x
    }

    /// Location of a block: its points have slots, or it is entirely inside or outside.
    pub(super) fn block_at(&self, block: usize) -> At {
        match self.state[block] {
            OUTSIDE => At::Outside,
            INSIDE => At::Inside,
            stored => At::Slot(stored * BLOCK_POINTS as u32),
        }
    }

    /// The slots of each stored block.
    pub(super) fn stored_blocks(&self) -> impl IndexedParallelIterator<Item = std::ops::Range<u32>> {
        let points = BLOCK_POINTS as u32;
        (0..self.stored.len() as u32).into_par_iter().map(move |b| b * points..(b + 1) * points)
    }

    /// The lower cell of a block.
    pub(super) fn first_cell(&self, block: usize) -> [usize; 3] {
        let [nx, ny, _] = self.count;
        [block % nx, block / nx % ny, block / nx / ny].map(|b| b * BLOCK)
    }

    /// Numbers of the stored blocks among all blocks.
    pub(super) fn stored(&self) -> &[u32] {
        &self.stored
    }

    /// The field at the centre of a cube of cells, and its largest possible change from there to
    /// the cube's corners.
    pub(super) fn probe(&self, shape: &dyn SignedDistance, first: [usize; 3], size: usize) -> (f64, f64) {
        let centre = self.position(first.map(|c| (2 * c + size) as i32));
        (shape.distance(centre), MAX_SLOPE * 0.5 * 3f64.sqrt() * size as f64 * self.cell)
    }
}
