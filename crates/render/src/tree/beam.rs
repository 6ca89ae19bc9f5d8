//! What neighbouring rays from one place can meet, found once for all of them.

use super::{Boxes, LEAF, NONE, Node, ROOT, WIDE};
use glam::Vec3A;

/// Covers the rounding of a ray's own way to a box.
const SLACK: f32 = 1e-5;

/// How often the nodes below one entry may be parted before a beam stops going down.
const PARTINGS: usize = 3;

/// Rays from one origin whose directions lie between two corners.
#[derive(Clone, Debug)]
pub(crate) struct Beam {
    origin: [f32; 3],
    /// One over the least and the greatest component along each axis; none where they differ in sign.
    inverse: [Option<[f32; 2]>; 3],
}

impl Boxes {
    /// The leaves that rays of `beam` may meet, with the least distance at which one could, in units of the directions.
    pub fn beam(&self, beam: &Beam, leaves: &mut Vec<(f32, u32)>) {
        leaves.clear();
        if self.nodes.is_empty() {
            return;
        }
        let mut open = vec![ROOT];
        while let Some(at) = open.pop() {
            let node = &self.nodes[at as usize];
            let (near, far) = beam.cross(node);
            for lane in 0..WIDE {
                let child = node.child[lane];
                if child == NONE || near[lane] > far[lane] {
                    continue;
                }
                if child & LEAF != 0 {
                    leaves.push((near[lane], child & !LEAF));
                } else {
                    open.push(child);
                }
            }
        }
    }

    /// Goes down from `entry` for as long as the beam meets few children, so that its rays need not do so one by one: gives `found` entries below which is all that they may meet, each with
    /// the least distance at which one could.
    pub fn narrow(&self, beam: &Beam, entry: u32, near: f32, mut found: impl FnMut(f32, u32)) {
        // Each parting adds one to what is open.
        let mut open = [(near, entry); PARTINGS + 1];
        let (mut count, mut partings) = (1, 0);
        while count > 0 {
            count -= 1;
            let (near, at) = open[count];
            let Some(node) = self.nodes.get(at as usize).filter(|_| at & LEAF == 0) else {
                found(near, at);
                continue;
            };
            let (enter, leave) = beam.cross(node);
            let met = |lane: &usize| node.child[*lane] != NONE && enter[*lane] <= leave[*lane];
            match (0..WIDE).filter(met).count() {
                0 => {}
                n if n == 1 || (n == 2 && partings < PARTINGS) => {
                    partings += n - 1;
                    for lane in (0..WIDE).filter(met) {
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
    /// Rays from `origin` in any of `directions`.
    pub fn new(origin: Vec3A, directions: impl Iterator<Item = Vec3A>) -> Self {
        let empty = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (low, high) = directions.fold(empty, |(low, high), d| (low.min(d), high.max(d)));
        let inverse = [0, 1, 2].map(|k| (low[k] * high[k] > 0.0).then(|| [1.0 / low[k], 1.0 / high[k]]));
        Self { origin: origin.to_array(), inverse }
    }

    /// Least distance at which any ray enters each child's box, and greatest at which one leaves it.
    fn cross(&self, node: &Node) -> ([f32; WIDE], [f32; WIDE]) {
        let (mut near, mut far) = ([0.0_f32; WIDE], [f32::INFINITY; WIDE]);
        for k in 0..3 {
            let Some([a, b]) = self.inverse[k] else { continue };
            let (first, last) = if a > 0.0 { (k, k + 3) } else { (k + 3, k) };
            for lane in 0..WIDE {
                let enter = node.bounds[first][lane] - self.origin[k];
                let leave = node.bounds[last][lane] - self.origin[k];
                // Comparisons that are one instruction for several lanes; `min` and `max` are not, for they look for what is no number.
                let (first, second) = (enter * a, enter * b);
                let least = if first < second { first } else { second };
                near[lane] = if near[lane] > least { near[lane] } else { least };
                let (first, second) = (leave * a, leave * b);
                let most = if first > second { first } else { second };
                far[lane] = if far[lane] < most { far[lane] } else { most };
            }
        }
        (near.map(|t| t * (1.0 - SLACK)), far.map(|t| t * (1.0 + SLACK)))
    }
}
