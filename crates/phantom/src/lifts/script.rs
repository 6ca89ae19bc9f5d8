//! Which lifts are filmed: where, how high, and when.

use glam::DVec3;
use trocar_core::Random;
use trocar_core::interpolate::smoothstep;

/// Least and greatest displacement of the grasp point (m), as in the paper.
pub(crate) const DISPLACEMENT: [f64; 2] = [0.011, 0.038];

/// Organ coordinates between which an instrument grasps.
const GRASP: [f64; 2] = [0.56, 0.78];

/// Displacement towards the base, and its greatest random part to either side, over the rise.
const TOWARDS_BASE: f64 = 0.2;
const ASIDE: f64 = 0.15;

/// Frames before the instrument comes, while it comes, while it lifts, and at the top.
const STILL: usize = 6;
const APPROACH: usize = 14;
const RISE: usize = 50;
const TOP: usize = 10;

/// Frames of one lift.
pub(crate) const FRAMES: usize = STILL + APPROACH + RISE + TOP;

/// Frame within a lift in which the tissue lies still.
pub(crate) const REST: usize = STILL / 2;

/// First frame within a lift in which the tissue moves.
pub(crate) const FIRST: usize = STILL + APPROACH;

/// One lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LiftScript {
    /// Organ coordinate of the grasp.
    pub at: f64,
    /// Length of the displacement of the grasp point (m).
    pub displacement: f64,
    /// Random number in [-1, 1) that turns the displacement aside.
    pub aside: f64,
}

/// `count` lifts whose places and heights cover their ranges evenly.
pub(crate) fn draw(count: usize, seed: u64) -> Vec<LiftScript> {
    let random = Random::from_keys(&[seed, 301]);
    let order = |stream: u64| {
        let key = |i: usize| random.stream(stream).bits(i as u64);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|i| key(*i));
        order
    };
    let (places, heights) = (order(1), order(2));
    let within = |[low, high]: [f64; 2], rank: usize, stream: u64| {
        let share = (rank as f64 + random.stream(stream).uniform(rank as u64)) / count as f64;
        low + (high - low) * share
    };
    (0..count)
        .map(|i| LiftScript {
            at: within(GRASP, places[i], 3),
            displacement: within(DISPLACEMENT, heights[i], 4),
            aside: random.stream(5).symmetric(i as u64),
        })
        .collect()
}

impl LiftScript {
    /// Displacement of the grasp point (m): up, somewhat towards the base, and somewhat aside.
    /// `towards` leads from the grasp to the base.
    pub fn way(&self, up: DVec3, towards: DVec3) -> DVec3 {
        let level = (towards - up * towards.dot(up)).normalize_or(up.any_orthonormal_vector());
        let direction = up + TOWARDS_BASE * level + ASIDE * self.aside * up.cross(level);
        self.displacement * direction.normalize()
    }
}

/// Share of the displacement in frame `frame` of a lift.
pub(crate) fn progress(frame: usize) -> f64 {
    let t = (frame as f64 - FIRST as f64 + 1.0) / RISE as f64;
    smoothstep(t.clamp(0.0, 1.0))
}

/// How near the instrument is in frame `frame` of a lift: 0 far, 1 at the tissue.
pub(crate) fn nearness(frame: usize) -> f64 {
    let t = (frame as f64 - STILL as f64 + 1.0) / APPROACH as f64;
    smoothstep(t.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifts_cover_their_ranges() {
        for count in [1, 4, 9] {
            let lifts = draw(count, 3);
            assert_eq!(lifts, draw(count, 3), "the same seed");
            assert_ne!(lifts, draw(count, 4), "another seed");
            let mut heights: Vec<f64> = lifts.iter().map(|l| l.displacement).collect();
            heights.sort_by(f64::total_cmp);
            let width = (DISPLACEMENT[1] - DISPLACEMENT[0]) / count as f64;
            for (i, height) in heights.iter().enumerate() {
                let low = DISPLACEMENT[0] + i as f64 * width;
                assert!((low..=low + width).contains(height), "{height} m is lift {i} of {count}");
            }
            assert!(lifts.iter().all(|l| (GRASP[0]..=GRASP[1]).contains(&l.at)));
        }
    }

    #[test]
    fn the_tissue_moves_only_after_the_instrument_has_come() {
        assert_eq!((progress(FIRST - 1), nearness(FIRST - 1)), (0.0, 1.0));
        assert!(progress(FIRST) > 0.0 && nearness(REST) == 0.0);
        assert_eq!(progress(FRAMES - TOP), 1.0);
        assert_eq!(FRAMES, 80);
    }

    #[test]
    fn the_way_has_its_length_and_rises() {
        let lift = LiftScript { at: 0.6, displacement: 0.02, aside: 0.5 };
        let way = lift.way(-DVec3::Z, DVec3::new(0.03, 0.01, 0.004));
        assert!((way.length() - 0.02).abs() < 1e-12 && way.z < -0.018 && way.x > 0.0);
    }
}
