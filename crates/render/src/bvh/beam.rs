//! Candidates for a bundle of neighbouring rays, found once for all of them.

use super::boxes::BoxTree;
use super::node::{LEAF_BIT, NO_CHILD, Node, ROOT, WIDTH};
use glam::Vec3A;

/// Relative margin for the rounding error of a ray's distance to a box.
const DISTANCE_MARGIN: f32 = 1e-5;

/// Maximum number of splits below one entry.
const MAX_SPLITS: usize = 3;

/// Rays from one origin, bounded by the extreme components of their directions.
#[derive(Clone, Debug)]
pub(crate) struct Beam {
    origin: [f32; 3],
    /// Reciprocals of the least and the greatest component along each axis; `None` if they differ
    /// in sign.
    inverse: [Option<[f32; 2]>; 3],
}

impl BoxTree {
    /// Collects the leaves that rays of `beam` may meet, each with the minimum distance in units of
    /// the directions.
    pub fn beam(&self, beam: &Beam, leaves: &mut Vec<(f32, u32)>) {
        leaves.clear();
        if self.nodes.is_empty() {
            return;
        }
        let mut open = vec![ROOT];
        while let Some(at) = open.pop() {
            let node = &self.nodes[at as usize];
            let (near, far) = beam.cross(node);
            for lane in 0..WIDTH {
                let child = node.child[lane];
                if child == NO_CHILD || near[lane] > far[lane] {
                    continue;
                }
                if child & LEAF_BIT != 0 {
                    leaves.push((near[lane], child & !LEAF_BIT));
                } else {
                    open.push(child);
                }
            }
        }
    }

    /// Descends from `entry` while the beam meets few children, so its rays need not do so one by
    /// one. Calls `found` with entries that together contain everything the rays may meet, each
    /// with its minimum distance.
    pub fn narrow(&self, beam: &Beam, entry: u32, near: f32, mut found: impl FnMut(f32, u32)) {
        // Each split adds one open entry.
        let mut open = [(near, entry); MAX_SPLITS + 1];
        let (mut count, mut splits) = (1, 0);
        while count > 0 {
            count -= 1;
            let (near, at) = open[count];
            let Some(node) = self.nodes.get(at as usize).filter(|_| at & LEAF_BIT == 0) else {
                found(near, at);
                continue;
            };
            let (enter, leave) = beam.cross(node);
            let met = |lane: &usize| node.child[*lane] != NO_CHILD && enter[*lane] <= leave[*lane];
            match (0..WIDTH).filter(met).count() {
                0 => {}
                n if n == 1 || (n == 2 && splits < MAX_SPLITS) => {
                    splits += n - 1;
                    for lane in (0..WIDTH).filter(met) {
                        open[count] = (enter[lane], node.child[lane]);
                        count += 1;
                    }
                }
                _ => found(near, at),
            }
        }
    }
}

impl Beam {
    /// The beam from `origin` in any of `directions`.
    pub fn new(origin: Vec3A, directions: impl Iterator<Item = Vec3A>) -> Self {
        let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (low, high) = directions.fold(empty, |(low, high), d| (low.min(d), high.max(d)));
        let inverse = [0, 1, 2].map(|k| (low[k] * high[k] > 0.0).then(|| [1.0 / low[k], 1.0 / high[k]]));
        Self { origin: origin.to_array(), inverse }
    }

    /// For each child's box, the least distance at which any ray enters and the greatest at which
    /// one leaves.
    fn cross(&self, node: &Node) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut near, mut far) = ([0.0_f32; WIDTH], [f32::INFINITY; WIDTH]);
        for k in 0..3 {
            let Some([a, b]) = self.inverse[k] else { continue };
            let (first, last) = if a > 0.0 { (k, k + 3) } else { (k + 3, k) };
            for lane in 0..WIDTH {
                let enter = node.bounds[first][lane] - self.origin[k];
                let leave = node.bounds[last][lane] - self.origin[k];
                // Comparisons compile to one instruction for several lanes. `min` and `max` do not,
                // because they treat NaN separately.
                let (first, second) = (enter * a, enter * b);
                let least = if first < second { first } else { second };
                near[lane] = if near[lane] > least { near[lane] } else { least };
                let (first, second) = (leave * a, leave * b);
                let most = if first > second { first } else { second };
                far[lane] = if far[lane] < most { far[lane] } else { most };
            }
        }
        (near.map(|t| t * (1.0 - DISTANCE_MARGIN)), far.map(|t| t * (1.0 + DISTANCE_MARGIN)))
    }
}
