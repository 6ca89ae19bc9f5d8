//! A body-centred cubic lattice that holds a signed distance at its points, stored only near the surface.
//!
//! A point is named by its coordinates in half cells: all three even at the corners of the cubic cells, all three odd at
//! their centres.

mod survey;

pub(super) use survey::jumps;

use crate::{Error, Result, SignedDistance};
use glam::DVec3;
use rayon::prelude::*;

/// A lattice point in half cells.
pub(super) type Point = [i32; 3];

/// The 14 steps from a point to its neighbours: 6 along the axes to the same sublattice (long edges), 8 along the space
/// diagonals to the other one (short edges).
pub(super) const STEPS: [Point; 14] = [
    [2, 0, 0],
    [-2, 0, 0],
    [0, 2, 0],
    [0, -2, 0],
    [0, 0, 2],
    [0, 0, -2],
    [-1, -1, -1],
    [1, -1, -1],
    [-1, 1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [1, 1, 1],
];

/// How many of [`STEPS`] are long.
pub(super) const LONG_STEPS: usize = 6;

/// Index of the step back.
pub(super) fn reverse(step: usize) -> usize {
    if step < LONG_STEPS { step ^ 1 } else { LONG_STEPS + 7 - (step - LONG_STEPS) }
}

/// Index of the step from `p` to its neighbour `q`.
pub(super) fn step_between(p: Point, q: Point) -> usize {
    let d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    match d.iter().position(|c| c.abs() == 2) {
        Some(axis) => 2 * axis + usize::from(d[axis] < 0),
        None => LONG_STEPS + usize::from(d[0] > 0) + 2 * usize::from(d[1] > 0) + 4 * usize::from(d[2] > 0),
    }
}

/// Cells along the edge of a block, the unit of storage.
pub(super) const BLOCK: usize = 8;
/// Points of a block: the lower corner and the centre of each of its cells.
pub(super) const BLOCK_POINTS: usize = 2 * BLOCK * BLOCK * BLOCK;
/// Cells of slack between the shape's bounds and the lattice's rim.
const MARGIN: f64 = 2.0;
/// Most blocks the lattice may span, stored or not.
const MAX_BLOCKS: f64 = (1 << 23) as f64;
/// Most points with a value; with at most 14 cut points to each, 32 bits number them all.
const MAX_SLOTS: usize = 1 << 26;
/// A distance changes no faster than the position. Estimates of a distance may; this much steeper is still handled.
const STEEPEST: f64 = 1.25;

/// What a block is, in the table of blocks; smaller numbers are those of stored blocks.
const OUTSIDE: u32 = u32::MAX;
const INSIDE: u32 = u32::MAX - 1;

/// What is known at a lattice point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum At {
    /// It lies in a block far outside the surface, or beyond the lattice.
    Outside,
    /// It lies in a block far inside the surface.
    Inside,
    /// It has a value.
    Slot(u32),
}

/// Signed distances at the points of a body-centred cubic lattice. A *slot* is the storage index of a point.
pub(super) struct Lattice {
    origin: DVec3,
    /// Edge of the cubic cell [m].
    pub(super) cell: f64,
    /// Blocks along each axis.
    pub(super) blocks: [usize; 3],
    /// Which stored block each block is, or `OUTSIDE` or `INSIDE`.
    stored: Vec<u32>,
    /// Which block each stored one is, ascending.
    block_of: Vec<u32>,
    /// The field at each slot [m]. Where the shape is far, only the sign is right.
    pub(super) values: Vec<f64>,
}

impl Lattice {
    /// Samples `shape` on the lattice that covers `bounds` [m] with cells of edge `cell` [m].
    pub(super) fn sample(shape: &dyn SignedDistance, bounds: (DVec3, DVec3), cell: f64) -> Result<Self> {
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
        let blocks = blocks.to_array().map(|n| n as usize);
        let mut lattice = Self { origin, cell, blocks, stored: Vec::new(), block_of: Vec::new(), values: Vec::new() };
        lattice.classify(shape);
        if lattice.block_of.len() > MAX_SLOTS / BLOCK_POINTS {
            return Err(too_fine());
        }
        let mut values = vec![0.0; lattice.block_of.len() * BLOCK_POINTS];
        values.par_chunks_mut(BLOCK_POINTS).zip(&lattice.block_of).for_each(|(values, &block)| {
            lattice.sample_cube(shape, lattice.first_cell(block as usize), [0; 3], BLOCK, values);
        });
        lattice.values = values;
        if let Some(slot) = lattice.values.iter().position(|v| !v.is_finite()) {
            return Err(Error::Mesh(format!(
                "the signed distance at {} m is {}; it must be finite",
                lattice.position(lattice.point(slot as u32)),
                lattice.values[slot]
            )));
        }
        match lattice.jump() {
            Some(at) => Err(jumps(at)),
            None => Ok(lattice),
        }
    }

    /// Position of a point [m].
    pub(super) fn position(&self, p: Point) -> DVec3 {
        self.origin + 0.5 * self.cell * DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
    }

    /// Length of a step [m].
    pub(super) fn step_length(&self, step: usize) -> f64 {
        if step < LONG_STEPS { self.cell } else { self.cell * 0.75f64.sqrt() }
    }

    /// The point at a slot.
    pub(super) fn point(&self, slot: u32) -> Point {
        let local = slot as usize % BLOCK_POINTS;
        let first = self.first_cell(self.block_of[slot as usize / BLOCK_POINTS] as usize);
        let (x, y, z) = (local / 2 % BLOCK, local / 2 / BLOCK % BLOCK, local / 2 / BLOCK / BLOCK);
        [x, y, z].map_with(first, |inside, first| (2 * (first + inside) + local % 2) as i32)
    }

    /// What is known at a point.
    pub(super) fn at(&self, p: Point) -> At {
        let cell = p.map(|c| (c >> 1) as usize);
        // A negative coordinate has become a huge one.
        if (0..3).any(|a| cell[a] >= self.blocks[a] * BLOCK) {
            return At::Outside;
        }
        match self.stored[self.block(cell)] {
            OUTSIDE => At::Outside,
            INSIDE => At::Inside,
            stored => At::Slot(stored * BLOCK_POINTS as u32 + Self::local(p) as u32),
        }
    }

    /// The slot of a point; `None` when it is far from the surface or beyond the lattice.
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

    /// Number of the block that holds a cell.
    pub(super) fn block(&self, cell: [usize; 3]) -> usize {
        let [x, y, z] = cell.map(|c| c / BLOCK);
        (z * self.blocks[1] + y) * self.blocks[0] + x
    }

    /// What is known of a block: its points have slots, or it lies inside or outside as a whole.
    pub(super) fn block_at(&self, block: usize) -> At {
        match self.stored[block] {
            OUTSIDE => At::Outside,
            INSIDE => At::Inside,
            stored => At::Slot(stored * BLOCK_POINTS as u32),
        }
    }

    /// Whether a point is strictly inside: with a negative value, or far inside.
    pub(super) fn is_inside(&self, p: Point) -> bool {
        match self.at(p) {
            At::Outside => false,
            At::Inside => true,
            At::Slot(slot) => self.values[slot as usize] < 0.0,
        }
    }

    /// The point after a step.
    pub(super) fn neighbour(p: Point, step: usize) -> Point {
        p.map_with(STEPS[step], |a, b| a + b)
    }

    /// The slots of each stored block.
    pub(super) fn stored_blocks(&self) -> impl IndexedParallelIterator<Item = std::ops::Range<u32>> {
        let points = BLOCK_POINTS as u32;
        (0..self.block_of.len() as u32).into_par_iter().map(move |b| b * points..(b + 1) * points)
    }

    /// The lower cell of a block.
    pub(super) fn first_cell(&self, block: usize) -> [usize; 3] {
        let [nx, ny, _] = self.blocks;
        [block % nx, block / nx % ny, block / nx / ny].map(|b| b * BLOCK)
    }

    /// Fills the cube of `size` cells at `inner` (in cells, from the block's `first` cell) into the block's values:
    /// at once where its centre is so far from the surface that the sign cannot change, else in halves.
    fn sample_cube(
        &self,
        shape: &dyn SignedDistance,
        first: [usize; 3],
        inner: [usize; 3],
        size: usize,
        values: &mut [f64],
    ) {
        let cube_first = first.map_with(inner, |a, b| a + b);
        let known = if size > 1 {
            let (distance, reach) = self.probe(shape, cube_first, size);
            (distance.abs() > reach).then(|| distance - distance.signum() * reach)
        } else {
            None
        };
        if size > 2 && known.is_none() {
            for octant in 0..8 {
                let half = size / 2;
                let offset = [octant & 1, octant >> 1 & 1, octant >> 2].map(|bit| bit * half);
                self.sample_cube(shape, first, inner.map_with(offset, |a, b| a + b), half, values);
            }
            return;
        }
        for z in 0..size {
            for y in 0..size {
                for x in 0..size {
                    let at = inner.map_with([x, y, z], |a, b| a + b);
                    for odd in 0..2 {
                        let slot = 2 * ((at[2] * BLOCK + at[1]) * BLOCK + at[0]) + odd;
                        let point = first.map_with(at, |a, b| (2 * (a + b) + odd) as i32);
                        values[slot] = known.unwrap_or_else(|| shape.distance(self.position(point)));
                    }
                }
            }
        }
    }

    /// The field at the centre of a cube of cells, and how much it may change from there to the cube's corners.
    fn probe(&self, shape: &dyn SignedDistance, first: [usize; 3], size: usize) -> (f64, f64) {
        let centre = self.position(first.map(|c| (2 * c + size) as i32));
        (shape.distance(centre), STEEPEST * 0.5 * 3f64.sqrt() * size as f64 * self.cell)
    }
}

/// Component by component combination of two triples.
pub(super) trait MapWith<T: Copy> {
    fn map_with<B: Copy, R>(self, other: [B; 3], f: impl Fn(T, B) -> R) -> [R; 3];
}

impl<T: Copy> MapWith<T> for [T; 3] {
    fn map_with<B: Copy, R>(self, other: [B; 3], f: impl Fn(T, B) -> R) -> [R; 3] {
        [0, 1, 2].map(|i| f(self[i], other[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Ball(f64);
    impl SignedDistance for Ball {
        fn distance(&self, p: DVec3) -> f64 {
            p.length() - self.0
        }
    }

    #[test]
    fn steps_reverse_and_are_found() {
        for (i, step) in STEPS.iter().enumerate() {
            let p = [4, 6, 8];
            let q = Lattice::neighbour(p, i);
            assert_eq!(step_between(p, q), i);
            assert_eq!(step_between(q, p), reverse(i));
            assert_eq!(step.iter().all(|c| c % 2 == 0), i < LONG_STEPS);
        }
    }

    #[test]
    fn every_sign_is_right_and_slots_are_points() {
        let ball = Ball(1.0);
        let lattice = Lattice::sample(&ball, (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.04).unwrap();
        for slot in 0..lattice.values.len() as u32 {
            let p = lattice.point(slot);
            assert_eq!(lattice.slot(p), Some(slot));
            let truth = ball.distance(lattice.position(p));
            let value = lattice.values[slot as usize];
            assert!(value.signum() == truth.signum() && value.abs() <= truth.abs() + 1e-12);
            for step in 0..STEPS.len() {
                let sides = lattice.at(Lattice::neighbour(p, step));
                assert!(sides != if truth < 0.0 { At::Outside } else { At::Inside });
            }
        }
        assert_eq!(lattice.at([-1, 5, 5]), At::Outside);
        // The middle of the ball is known without a value.
        let middle = lattice.blocks.map(|n| (n * BLOCK) as i32);
        assert_eq!(lattice.at(middle), At::Inside);
        assert!(lattice.is_inside(middle) && !lattice.is_inside([0; 3]));
    }

    #[test]
    fn far_points_cost_no_evaluation() {
        struct Counting(std::sync::atomic::AtomicUsize);
        impl SignedDistance for Counting {
            fn distance(&self, p: DVec3) -> f64 {
                self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                p.length() - 1.0
            }
        }
        let counting = Counting(0.into());
        let lattice = Lattice::sample(&counting, (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.02).unwrap();
        let (evaluated, all) = (counting.0.into_inner(), lattice.blocks.iter().product::<usize>() * BLOCK_POINTS);
        println!("evaluated {evaluated} of {all} lattice points");
        assert!(evaluated < all / 4);
    }
}
