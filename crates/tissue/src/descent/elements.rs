//! Elements in lanes: whether a motion squeezes any of them too far.

use crate::descent::sweep::{FLOOR, KEPT_SHARE};
use crate::simd::{BLOCK, Block, Isa, Lanes, Task, cross, dot, minus};
use glam::Vec3A;

/// The elements that can move, sixteen to a block. The offsets are in range for `points` points, and private.
#[derive(Clone, Debug, Default)]
pub(crate) struct Elements {
    points: usize,
    blocks: Vec<Elements16>,
}

#[derive(Clone, Debug)]
struct Elements16 {
    /// Corners, as offsets [bytes].
    corners: [Block<u32>; 4],
    /// 1 / (6 V0) [1/m3].
    inverse_6v: Block<f32>,
}

/// Bytes of a point.
const POINT: u32 = 16;

impl Elements {
    /// Those of `tets`, of volumes `volumes` [m3], that are not all pinned. None for bodies too large for byte offsets of 32 bits.
    pub fn new(tets: &[[u32; 4]], volumes: &[f64], pinned: impl Fn(u32) -> bool, points: usize) -> Option<Self> {
        if points > (u32::MAX / POINT) as usize || tets.iter().flatten().any(|i| *i as usize >= points) {
            return None;
        }
        let moving: Vec<usize> = (0..tets.len()).filter(|t| !tets[*t].iter().all(|i| pinned(*i))).collect();
        let block = |chunk: &[usize]| {
            // Places left over hold the chunk's last element again.
            let at = |lane: usize| chunk[lane.min(chunk.len() - 1)];
            Elements16 {
                corners: [0, 1, 2, 3].map(|c| Block(std::array::from_fn(|lane| tets[at(lane)][c] * POINT))),
                inverse_6v: Block(std::array::from_fn(|lane| (1.0 / (6.0 * volumes[at(lane)])) as f32)),
            }
        };
        Some(Self { points, blocks: moving.chunks(BLOCK).map(block).collect() })
    }

    /// Whether the motion from `before` to `now` leaves an element less than a tenth of its volume and than the floor allows, unless it had less already.
    pub fn any_squeezed(&self, isa: Isa, before: &[Vec3A], now: &[Vec3A]) -> bool {
        assert!(before.len() == self.points && now.len() == self.points);
        isa.run(AnySqueezed { blocks: &self.blocks, before, now })
    }
}

/// The points are as many as the elements were made for.
struct AnySqueezed<'a> {
    blocks: &'a [Elements16],
    before: &'a [Vec3A],
    now: &'a [Vec3A],
}

impl Task for AnySqueezed<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        for block in self.blocks {
            for part in 0..L::PARTS {
                let before = ratio(lanes, block, part, self.before);
                let now = ratio(lanes, block, part, self.now);
                let floor = lanes.max(lanes.splat(KEPT_SHARE) * before, lanes.splat(FLOOR));
                if lanes.less(now, lanes.min(floor, before)) != 0 {
                    return true;
                }
            }
        }
        false
    }
}

/// Volume over rest volume of a part's elements.
#[inline(always)]
#[allow(unsafe_code, reason = "points are read by indices that the elements vouch for")]
fn ratio<L: Lanes>(lanes: L, block: &Elements16, part: usize, x: &[Vec3A]) -> L::F {
    let [a, b, c, d] = &block.corners;
    // SAFETY: the offsets are 16 times numbers below `Elements::points`, the length of `x` (`any_squeezed` asserts it).
    let (a, b, c, d) =
        unsafe { (lanes.rows(x, a, part), lanes.rows(x, b, part), lanes.rows(x, c, part), lanes.rows(x, d, part)) };
    let area = cross::<L>(minus::<L>(b, a), minus::<L>(c, a));
    dot::<L>(area, minus::<L>(d, a)) * lanes.load(&block.inverse_6v, part)
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
        let elements = Elements::new(&tets, &volumes, |i| i < 4, before.len()).unwrap();
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
        assert!(Elements::new(&tets, &volumes, |_| false, 4).is_none());
    }
}
