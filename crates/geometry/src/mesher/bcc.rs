//! Signed distances at the points of a body-centred cubic lattice, stored only near the surface.

use super::blocks::{At, BLOCK, BLOCK_POINTS, Blocks};
use super::points::{MapWith, Point, STEPS, neighbour};
use crate::{Error, Result, SignedDistance};
use glam::DVec3;
use rayon::prelude::*;

/// A body-centred cubic lattice with a signed distance at each stored point.
pub(super) struct Lattice {
    /// Geometry and storage of the points.
    pub(super) blocks: Blocks,
    /// The field at each slot (m). Far from the surface only the sign is correct.
    pub(super) values: Vec<f64>,
}

impl Lattice {
    /// Samples `shape` on the lattice that covers `bounds` (m) with cells of edge `cell` (m).
    pub(super) fn sample(shape: &dyn SignedDistance, bounds: (DVec3, DVec3), cell: f64) -> Result<Self> {
        let blocks = Blocks::find(shape, bounds, cell)?;
        let mut values = vec![0.0; blocks.stored().len() * BLOCK_POINTS];
        values.par_chunks_mut(BLOCK_POINTS).zip(blocks.stored()).for_each(|(values, &block)| {
            sample_cube(&blocks, shape, blocks.first_cell(block as usize), [0; 3], BLOCK, values);
        });
        let lattice = Self { blocks, values };
        if let Some(slot) = lattice.values.iter().position(|v| !v.is_finite()) {
            return Err(Error::Mesh(format!(
                "the signed distance at {} m is {}; it must be finite",
                lattice.blocks.position(lattice.blocks.point(slot as u32)),
                lattice.values[slot]
            )));
        }
        match lattice.jump() {
            Some(at) => Err(jumps(at)),
            None => Ok(lattice),
        }
    }

    /// Whether a point is strictly inside: far inside, or with a negative value.
    pub(super) fn is_inside(&self, p: Point) -> bool {
        match self.blocks.at(p) {
            At::Outside => false,
            At::Inside => true,
            At::Slot(slot) => self.values[slot as usize] < 0.0,
        }
    }

    /// A point where the inside of the shape is adjacent to outside blocks or to the boundary of
    /// the lattice, without a surface between: the field jumps, or the bounds are too small.
    pub(super) fn jump(&self) -> Option<DVec3> {
        let blocks = &self.blocks;
        let all: usize = blocks.count.iter().product();
        (0..all).into_par_iter().find_map_first(|block| {
            let first = blocks.first_cell(block);
            let position = |p: Point| blocks.position(p);
            let state = blocks.block_at(block);
            if state == At::Inside {
                let clash = (0..27).any(|n: i32| {
                    let offset = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                    blocks.at(first.map_with(offset, |c, o| 2 * (c as i32 + o * BLOCK as i32))) == At::Outside
                });
                return clash.then(|| position(first.map(|c| (2 * c + BLOCK) as i32)));
            }
            let At::Slot(slots) = state else { return None };
            let rim = |c: i32| c % (2 * BLOCK as i32) < 2 || c % (2 * BLOCK as i32) > 2 * BLOCK as i32 - 3;
            (slots..slots + BLOCK_POINTS as u32).map(|slot| (slot, blocks.point(slot))).find_map(|(slot, p)| {
                let inside = self.values[slot as usize] < 0.0;
                let wrong = if inside { At::Outside } else { At::Inside };
                let clash =
                    p.iter().any(|&c| rim(c)) && (0..STEPS.len()).any(|step| blocks.at(neighbour(p, step)) == wrong);
                clash.then(|| position(p))
            })
        })
    }
}

/// Fills the values of the cube of `size` cells at `inner` (in cells from the block's `first`
/// cell). Uses one evaluation if the centre is so far from the surface that the sign cannot change,
/// and subdivides otherwise.
fn sample_cube(
    blocks: &Blocks,
    shape: &dyn SignedDistance,
    first: [usize; 3],
    inner: [usize; 3],
    size: usize,
    values: &mut [f64],
) {
    let cube_first = first.map_with(inner, |a, b| a + b);
    let known = if size > 1 {
        let (distance, reach) = blocks.probe(shape, cube_first, size);
        (distance.abs() > reach).then(|| distance - distance.signum() * reach)
    } else {
        None
    };
    if size > 2 && known.is_none() {
        for octant in 0..8 {
            let half = size / 2;
            let offset = [octant & 1, octant >> 1 & 1, octant >> 2].map(|bit| bit * half);
            sample_cube(blocks, shape, first, inner.map_with(offset, |a, b| a + b), half, values);
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
                    values[slot] = known.unwrap_or_else(|| shape.distance(blocks.position(point)));
                }
            }
        }
    }
}

/// The error for a field whose sign changes where its value excludes a change.
pub(super) fn jumps(at: DVec3) -> Error {
    Error::Mesh(format!(
        "the shape has an inside at {at} m, beyond its bounds or where its signed distance excludes one; widen the bounds, \
         or use a field that changes at most as fast as the position"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Ball;

    #[test]
    fn every_sign_is_right_and_slots_are_points() {
        let ball = Ball(1.0);
        let lattice = Lattice::sample(&ball, (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.04).unwrap();
        for slot in 0..lattice.values.len() as u32 {
            let p = lattice.blocks.point(slot);
            assert_eq!(lattice.blocks.slot(p), Some(slot));
            let truth = ball.distance(lattice.blocks.position(p));
            let value = lattice.values[slot as usize];
            assert!(value.signum() == truth.signum() && value.abs() <= truth.abs() + 1e-12);
            for step in 0..STEPS.len() {
                let sides = lattice.blocks.at(neighbour(p, step));
                assert!(sides != if truth < 0.0 { At::Outside } else { At::Inside });
            }
        }
        assert_eq!(lattice.blocks.at([-1, 5, 5]), At::Outside);
        // The middle of the ball is known to be inside without a value.
        let middle = lattice.blocks.count.map(|n| (n * BLOCK) as i32);
        assert_eq!(lattice.blocks.at(middle), At::Inside);
        assert!(lattice.is_inside(middle) && !lattice.is_inside([0; 3]));
    }

    #[test]
    fn far_points_need_no_evaluation() {
        struct Counting(std::sync::atomic::AtomicUsize);
        impl SignedDistance for Counting {
            fn distance(&self, p: DVec3) -> f64 {
                self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                p.length() - 1.0
            }
        }
        let counting = Counting(0.into());
        let lattice = Lattice::sample(&counting, (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.02).unwrap();
        let (evaluated, all) = (counting.0.into_inner(), lattice.blocks.count.iter().product::<usize>() * BLOCK_POINTS);
        assert!(evaluated < all / 4);
    }
}
