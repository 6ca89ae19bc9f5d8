//! Cut points, where lattice edges cross the surface, and the lattice points that are moved onto
//! it.

use super::bcc::Lattice;
use super::blocks::BLOCK_POINTS;
use super::points::{LONG_STEPS, Point, STEPS, neighbour, reverse, step_between};
use crate::{Error, Result, SignedDistance};
use glam::DVec3;
use rayon::prelude::*;

/// A lattice point is moved onto a cut point closer than this fraction of the edge. The values
/// maximise the smallest possible angle: every dihedral angle is between 10.7 and 165 degrees, as
/// the test module `bound` verifies. The values of Labelle and Shewchuk (2007), table 1, give 9.3
/// degrees with these stencils.
pub(super) const SNAP_LONG: f64 = 0.284;
/// As [`SNAP_LONG`], for short edges.
pub(super) const SNAP_SHORT: f64 = 0.399;
/// Tolerance of the distance at a cut point, as a fraction of the cell.
const ON_SURFACE: f64 = 1e-4;

/// The crossing of an edge from an inside point to an outside point.
struct Cut {
    /// Slot of the inside end and the step from there to the outside end.
    inside: u32,
    step: u8,
    outside: u32,
    /// Position of the crossing, as a fraction of the edge from the inside end.
    share: f64,
    /// False after an end of the edge moved onto the surface.
    alive: bool,
}

/// The cut points of a lattice and the moved lattice points.
pub(super) struct Cuts {
    /// Ordered by inside end, then step.
    cuts: Vec<Cut>,
    /// First cut of each stored block, and the number of cuts.
    starts: Vec<u32>,
    /// Slot and new position of each moved point, ordered by slot.
    moved: Vec<(u32, DVec3)>,
}

impl Cuts {
    /// Finds every crossing.
    pub(super) fn find(lattice: &Lattice, shape: &dyn SignedDistance) -> Result<Self> {
        let found: Vec<Vec<Cut>> = lattice
            .blocks
            .stored_blocks()
            .map(|slots| {
                let mut cuts = Vec::new();
                for inside in slots.filter(|&slot| lattice.values[slot as usize] < 0.0) {
                    let p = lattice.blocks.point(inside);
                    for step in 0..STEPS.len() {
                        let q = neighbour(p, step);
                        // A point without a slot is deep inside.
                        let Some(outside) = lattice.blocks.slot(q) else { continue };
                        if lattice.values[outside as usize] > 0.0 {
                            let share = crossing(lattice, shape, inside, outside, step);
                            cuts.push(Cut { inside, step: step as u8, outside, share, alive: true });
                        }
                    }
                }
                cuts
            })
            .collect();
        let mut starts = vec![0];
        starts.extend(found.iter().scan(0, |sum, cuts| {
            *sum += cuts.len() as u32;
            Some(*sum)
        }));
        let cuts: Vec<Cut> = found.into_iter().flatten().collect();
        if let Some(cut) = cuts.iter().find(|cut| cut.share.is_nan()) {
            let at = lattice.blocks.position(lattice.blocks.point(cut.inside));
            return Err(Error::Mesh(format!("the signed distance near {at} m is not a number")));
        }
        Ok(Self { cuts, starts, moved: Vec::new() })
    }

    /// Moves each lattice point with a cut point that is too close onto the closest one. The point
    /// is then on the surface (value 0), and the cut points on its edges are discarded. Points are
    /// visited in slot order.
    pub(super) fn warp(&mut self, lattice: &mut Lattice) {
        let mut touched: Vec<u32> = self.cuts.iter().flat_map(|cut| [cut.inside, cut.outside]).collect();
        touched.sort_unstable();
        touched.dedup();
        for slot in touched {
            let p = lattice.blocks.point(slot);
            let here: Vec<usize> = (0..STEPS.len()).filter_map(|step| self.index_at(lattice, slot, p, step)).collect();
            let mut closest: Option<(f64, usize)> = None;
            for &index in here.iter().filter(|&&index| self.cuts[index].alive) {
                let cut = &self.cuts[index];
                let share = if cut.inside == slot { cut.share } else { 1.0 - cut.share };
                let snap = if usize::from(cut.step) < LONG_STEPS { SNAP_LONG } else { SNAP_SHORT };
                let distance = share * lattice.blocks.step_length(usize::from(cut.step));
                if share < snap && closest.is_none_or(|(least, _)| distance < least) {
                    closest = Some((distance, index));
                }
            }
            if let Some((_, index)) = closest {
                self.moved.push((slot, self.position(lattice, index)));
                lattice.values[slot as usize] = 0.0;
                for index in here {
                    self.cuts[index].alive = false;
                }
            }
        }
    }

    /// Index of the cut point on the edge from the inside point `p` to the outside point `q`.
    pub(super) fn between(&self, lattice: &Lattice, p: Point, q: Point) -> Option<usize> {
        self.index(lattice.blocks.slot(p)?, step_between(p, q))
    }

    /// Position of a cut point (m).
    pub(super) fn position(&self, lattice: &Lattice, index: usize) -> DVec3 {
        let Cut { inside, outside, share, .. } = self.cuts[index];
        lattice
            .blocks
            .position(lattice.blocks.point(inside))
            .lerp(lattice.blocks.position(lattice.blocks.point(outside)), share)
    }

    /// Position of a lattice point after the warp (m).
    pub(super) fn position_of_point(&self, lattice: &Lattice, slot: u32) -> DVec3 {
        match self.moved.binary_search_by_key(&slot, |&(slot, _)| slot) {
            Ok(found) => self.moved[found].1,
            Err(_) => lattice.blocks.position(lattice.blocks.point(slot)),
        }
    }

    /// Number of cut points, including discarded ones.
    pub(super) fn len(&self) -> usize {
        self.cuts.len()
    }

    /// The cut on the edge that leaves `p` by `step`, whichever end is inside.
    fn index_at(&self, lattice: &Lattice, slot: u32, p: Point, step: usize) -> Option<usize> {
        self.index(slot, step).or_else(|| self.index(lattice.blocks.slot(neighbour(p, step))?, reverse(step)))
    }

    fn index(&self, inside: u32, step: usize) -> Option<usize> {
        let block = inside as usize / BLOCK_POINTS;
        let (start, end) = (self.starts[block] as usize, self.starts[block + 1] as usize);
        let found = self.cuts[start..end].binary_search_by_key(&(inside, step as u8), |cut| (cut.inside, cut.step));
        found.ok().map(|at| start + at)
    }
}

/// Position of the zero of the field, as a fraction of the way from the inside to the outside
/// point, by the Illinois variant of regula falsi. NaN if the field is NaN.
fn crossing(lattice: &Lattice, shape: &dyn SignedDistance, inside: u32, outside: u32, step: usize) -> f64 {
    let start = lattice.blocks.point(inside);
    let (p, q) = (lattice.blocks.position(start), lattice.blocks.position(neighbour(start, step)));
    let (mut low, mut high) = (0.0, 1.0);
    let (mut at_low, mut at_high) = (lattice.values[inside as usize], lattice.values[outside as usize]);
    let mut last_low: Option<bool> = None;
    let mut share = 0.5;
    // Convergence is superlinear for a distance. Halving the weight of an end that does not move
    // bounds the number of steps for other fields.
    for _ in 0..50 {
        share = low + (high - low) * at_low / (at_low - at_high);
        let value = shape.distance(p.lerp(q, share));
        if value.is_nan() {
            return f64::NAN;
        }
        if value.abs() <= ON_SURFACE * lattice.blocks.cell || high - low < ON_SURFACE * 0.1 {
            break;
        }
        if value < 0.0 {
            (low, at_low) = (share, value);
            at_high *= if last_low == Some(true) { 0.5 } else { 1.0 };
        } else {
            (high, at_high) = (share, value);
            at_low *= if last_low == Some(false) { 0.5 } else { 1.0 };
        }
        last_low = Some(value < 0.0);
    }
    share
}
