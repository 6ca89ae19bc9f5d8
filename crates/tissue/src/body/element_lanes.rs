//! Elements in lanes: whether a motion squeezes any of them too far.

use crate::Isa;
use crate::inversion_guard::{KEPT_SHARE, MIN_VOLUME_RATIO};
use crate::lanes::{cross, dot, sub};
use crate::registers::{BLOCK, Block, Reg, load, parts, rows, splat};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch};
use glam::Vec3A;

/// The elements that can move, sixteen to a block.
#[derive(Clone, Debug, Default)]
pub(crate) struct ElementLanes {
    points: usize,
    blocks: Vec<Elements16>,
}

#[derive(Clone, Debug)]
struct Elements16 {
    corners: [Block<u32>; 4],
    /// 1 / (6 V0) (1/m3).
    inverse_6v: Block<f32>,
}

impl ElementLanes {
    /// Those of `tets`, of volumes `volumes` (m3), that are not all pinned. None if a corner is not
    /// among the `points` nodes.
    pub fn new(tets: &[[u32; 4]], volumes: &[f64], pinned: impl Fn(u32) -> bool, points: usize) -> Option<Self> {
        if tets.iter().flatten().any(|i| *i as usize >= points) {
            return None;
        }
        let moving: Vec<usize> = (0..tets.len()).filter(|t| !tets[*t].iter().all(|i| pinned(*i))).collect();
        let block = |chunk: &[usize]| {
            // Spare lanes repeat the last element of the chunk.
            let at = |lane: usize| chunk[lane.min(chunk.len() - 1)];
            Elements16 {
                corners: [0, 1, 2, 3].map(|c| Block(std::array::from_fn(|lane| tets[at(lane)][c]))),
                inverse_6v: Block(std::array::from_fn(|lane| (1.0 / (6.0 * volumes[at(lane)])) as f32)),
            }
        };
        Some(Self { points, blocks: moving.chunks(BLOCK).map(block).collect() })
    }

    /// Whether the motion from `before` to `now` squeezes an element
    /// ([`crate::inversion_guard::is_squeezed`]).
    pub fn any_squeezed(&self, isa: Isa, before: &[Vec3A], now: &[Vec3A]) -> bool {
        assert!(before.len() == self.points && now.len() == self.points);
        dispatch!(isa.level(), simd => any_squeezed(simd, &self.blocks, before, now))
    }
}

#[inline(always)]
fn any_squeezed<S: Simd>(simd: S, blocks: &[Elements16], before: &[Vec3A], now: &[Vec3A]) -> bool {
    for block in blocks {
        for part in 0..parts::<S>() {
            let before = ratio(simd, block, part, before);
            let now = ratio(simd, block, part, now);
            let floor = (splat(simd, KEPT_SHARE) * before).max(splat(simd, MIN_VOLUME_RATIO));
            if now.simd_lt(floor.min(before)).any_true() {
                return true;
            }
        }
    }
    false
}

/// Volume over rest volume of a part's elements.
#[inline(always)]
fn ratio<S: Simd>(simd: S, block: &Elements16, part: usize, x: &[Vec3A]) -> Reg<S> {
    let [a, b, c, d] = &block.corners;
    let (a, b) = (rows(simd, x, a, part), rows(simd, x, b, part));
    let (c, d) = (rows(simd, x, c, part), rows(simd, x, d, part));
    dot(cross(sub(b, a), sub(c, a)), sub(d, a)) * load(simd, &block.inverse_6v, part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_squeezed_element_is_found_wherever_it_is() {
        let tets: Vec<[u32; 4]> = (0..37).map(|t| [4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3]).collect();
        let before: Vec<Vec3A> =
            (0..37 * 4).map(|i| [Vec3A::ZERO, Vec3A::X, Vec3A::Y, Vec3A::Z][i % 4] * (1.0 + i as f32)).collect();
        let volume = |t: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| before[4 * t + k].as_dvec3());
            (b - a).cross(c - a).dot(d - a) / 6.0
        };
        let volumes: Vec<f64> = (0..37).map(volume).collect();
        let elements = ElementLanes::new(&tets, &volumes, |i| i < 4, before.len()).unwrap();
        for isa in Isa::ALL {
            assert!(!elements.any_squeezed(isa, &before, &before));
            for t in 0..37 {
                let mut now = before.clone();
                now[4 * t + 3] *= 0.15;
                assert!(!elements.any_squeezed(isa, &before, &now));
                now[4 * t + 3] *= 0.5;
                // The first one is pinned, and cannot move.
                assert_eq!(elements.any_squeezed(isa, &before, &now), t != 0, "{} {t}", isa.name());
                assert!(!elements.any_squeezed(isa, &now, &now));
            }
        }
        assert!(ElementLanes::new(&tets, &volumes, |_| false, 4).is_none());
    }
}
