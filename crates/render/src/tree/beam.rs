//! What neighbouring rays from one place can meet, found once for all of them.

use super::{Boxes, LEAF, NONE, Node, ROOT, WIDE};
use glam::Vec3A;

/// Covers the rounding of a ray's own way to a box.
const SLACK: f32 = 1e-5;

/// Rays from one origin whose directions lie between two corners.
struct Beam {
    origin: [f32; 3],
    /// One over the least and the greatest component along each axis; none where they differ in sign.
    inverse: [Option<[f32; 2]>; 3],
}

impl Boxes {
    /// The leaves that rays from `origin` in any of `directions` may meet, with the least distance at which one could, in units of
    /// the directions, the nearest first.
    pub fn beam(&self, origin: Vec3A, directions: &[Vec3A], leaves: &mut Vec<(f32, u32)>) {
        leaves.clear();
        let low = directions.iter().copied().fold(Vec3A::INFINITY, Vec3A::min);
        let high = directions.iter().copied().fold(Vec3A::NEG_INFINITY, Vec3A::max);
        if self.nodes.is_empty() || directions.is_empty() {
            return;
        }
        let inverse = [0, 1, 2].map(|k| (low[k] * high[k] > 0.0).then(|| [1.0 / low[k], 1.0 / high[k]]));
        let beam = Beam { origin: origin.to_array(), inverse };
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
        leaves.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
}

impl Beam {
    /// Least distance at which any ray enters each child's box, and greatest at which one leaves it.
    fn cross(&self, node: &Node) -> ([f32; WIDE], [f32; WIDE]) {
        let (mut near, mut far) = ([0.0_f32; WIDE], [f32::INFINITY; WIDE]);
        for k in 0..3 {
            let Some([a, b]) = self.inverse[k] else { continue };
            let (first, last) = if a > 0.0 { (k, k + 3) } else { (k + 3, k) };
            for lane in 0..WIDE {
                let enter = node.bounds[first][lane] - self.origin[k];
                let leave = node.bounds[last][lane] - self.origin[k];
                near[lane] = near[lane].max((enter * a).min(enter * b));
                far[lane] = far[lane].min((leave * a).max(leave * b));
            }
        }
        (near.map(|t| t * (1.0 - SLACK)), far.map(|t| t * (1.0 + SLACK)))
    }
}
