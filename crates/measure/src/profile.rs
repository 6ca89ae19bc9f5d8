//! Profiles of a lift along an organ, and their half-drop distance (paper Fig. 7(d)).

use crate::smooth::smooth;
use serde::Serialize;

/// The lift along an organ at one instant: how far each place has risen over the plane of its
/// surroundings since the frame at rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiftProfile {
    /// Distance between two places along the organ (m).
    pub spacing: f64,
    /// Smoothed lift at each place from the base on (m); places that are hidden are bridged.
    pub lift: Vec<f64>,
    /// Whether each place is seen.
    pub seen: Vec<bool>,
    /// Place of the greatest lift (m along the organ).
    pub apex_at: f64,
    /// Greatest lift (m).
    pub apex: f64,
    /// Distances from the apex to where the lift falls to half, towards the base and towards the
    /// tip (m); `None` where it does not within the seen part.
    pub half_drop: [Option<f64>; 2],
}

impl LiftProfile {
    /// The profile of lifts (m) at places `spacing` (m) apart; `None` where a place is hidden.
    /// `None` if fewer than two places are seen or nothing rises.
    pub fn of(lifts: &[Option<f64>], spacing: f64) -> Option<Self> {
        let lift = smooth(lifts)?;
        let seen: Vec<bool> = lifts.iter().map(Option::is_some).collect();
        let (first, last) = (seen.iter().position(|s| *s)?, seen.iter().rposition(|s| *s)?);
        let top = (first..=last).max_by(|a, b| lift[*a].total_cmp(&lift[*b]).then(b.cmp(a)))?;
        let (apex, shift) = parabola(&lift, top, first, last);
        if apex <= 0.0 {
            return None;
        }
        let apex_at = (top as f64 + shift) * spacing;
        let towards_base = (first..top).rev().find(|i| lift[*i] <= 0.5 * apex).map(|i| crossing(&lift, i, i + 1, apex));
        let towards_tip = (top + 1..=last).find(|i| lift[*i] <= 0.5 * apex).map(|i| crossing(&lift, i - 1, i, apex));
        let half_drop = [towards_base, towards_tip].map(|at| at.map(|at| (at * spacing - apex_at).abs()));
        Some(Self { spacing, lift, seen, apex_at, apex, half_drop })
    }

    /// The half-drop distance d50 (m): the mean of both sides, or the one that is known.
    pub fn d50(&self) -> Option<f64> {
        let known: Vec<f64> = self.half_drop.iter().flatten().copied().collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }
}

/// The top of the parabola through the highest place and its neighbours: height and shift.
fn parabola(lift: &[f64], top: usize, first: usize, last: usize) -> (f64, f64) {
    if top <= first || top >= last {
        return (lift[top], 0.0);
    }
    let [a, b, c] = [lift[top - 1], lift[top], lift[top + 1]];
    let (slope, bend) = (0.5 * (c - a), a - 2.0 * b + c);
    if bend >= 0.0 {
        return (b, 0.0);
    }
    let shift = (-slope / bend).clamp(-0.5, 0.5);
    (b + slope * shift + 0.5 * bend * shift * shift, shift)
}

/// Where the lift is half of the apex between two neighbours.
fn crossing(lift: &[f64], a: usize, b: usize, apex: f64) -> f64 {
    let (from, to) = (lift[a], lift[b]);
    a as f64 + if from == to { 0.5 } else { (0.5 * apex - from) / (to - from) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bell that falls to half at `half` (m) from its top at 42.3 mm.
    fn bell(height: f64, half: f64) -> Vec<Option<f64>> {
        let lift = |i: usize| height * (-std::f64::consts::LN_2 * ((i as f64 * 1e-3 - 42.3e-3) / half).powi(2)).exp();
        (0..86).map(|i| Some(lift(i))).collect()
    }

    #[test]
    fn a_known_profile_gives_its_half_drop_distance() {
        for (height, half) in [(0.015, 0.011), (0.03, 0.018)] {
            let profile = LiftProfile::of(&bell(height, half), 1e-3).unwrap();
            assert!((profile.apex - height).abs() < 0.3e-3, "{}", profile.apex);
            assert!((profile.apex_at - 42.3e-3).abs() < 0.2e-3, "{}", profile.apex_at);
            for side in profile.half_drop {
                assert!((side.unwrap() - half).abs() < 0.3e-3, "{side:?} for {half}");
            }
            assert!((profile.d50().unwrap() - half).abs() < 0.3e-3);
        }
    }

    #[test]
    fn hidden_places_around_the_top_are_bridged() {
        let mut lifts = bell(0.02, 0.016);
        lifts[38..48].fill(None);
        let profile = LiftProfile::of(&lifts, 1e-3).unwrap();
        assert!((profile.apex - 0.02).abs() < 0.8e-3, "{}", profile.apex);
        assert!((profile.d50().unwrap() - 0.016).abs() < 0.8e-3, "{:?}", profile.half_drop);
        assert_eq!(profile.seen.iter().filter(|s| !**s).count(), 10);
    }

    #[test]
    fn a_side_that_does_not_fall_to_half_is_unknown() {
        let mut lifts = bell(0.02, 0.016);
        lifts.truncate(50);
        let profile = LiftProfile::of(&lifts, 1e-3).unwrap();
        assert!(profile.half_drop[0].is_some() && profile.half_drop[1].is_none());
        assert_eq!(profile.d50(), profile.half_drop[0]);
        assert_eq!(LiftProfile::of(&vec![Some(-1e-3); 30], 1e-3), None, "nothing rises");
    }
}
