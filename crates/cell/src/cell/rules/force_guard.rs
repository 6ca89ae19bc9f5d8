//! Rule: no arm presses an instrument harder into tissue than the scene's force limit, nor strains
//! tissue to what the other rules would release.
//!
//! Controllers of real arms stop where the contact force is beyond a threshold; an FR3's is 20 N
//! for a tip in the open ("collision behaviour" in Franka's control interface). In tissue a stop is
//! not enough, because the pressure remains. So the guard does two things:
//!
//! - Commands, 30 times a second: the part of a motion against the load becomes shorter as the load
//!   nears the limit; beyond the limit the instrument retracts, and goes less far aside, because
//!   what slides along tissue under a high load is pressed into it where it curves. The motion is
//!   measured from the arm's reference, because commands are up to 20 mm ahead of a fast arm.
//! - Stops, 60 times a second: an arm that would pass the limit before the next chance to stop it
//!   stops at once, and so does one that is about to hit tissue fast ([`super::approach`]).
//!
//! The stiffness seen so far tells how far a step may go, as in [`crate::Jaw`]: a fixed gain would
//! oscillate on stiff tissue or be slow on soft tissue. The rest of the motion is as commanded.
//!
//! The load is the force on the instrument. Where the strain of tissue is nearer to its limit than
//! the force is to the force limit, the load has that share of the limit.

use super::TissueAtArm;
use crate::FRAME;
use glam::DVec3;

/// Share of the remaining load that one step uses.
const GAIN: f64 = 0.3;

/// The guard shortens commands from this share of the limit on.
const FROM_SHARE: f64 = 0.5;

/// Within this share of the limit the instrument stands still.
const DEADBAND: f64 = 0.02;

/// Minimum and maximum assumed stiffness of tissue (N/m).
const STIFFNESS: [f64; 2] = [2e3, 5e4];

/// Beyond this multiple of the limit the instrument goes no way but back.
const STILL_FROM: f64 = 1.5;

/// Decay of the stiffness from one tissue frame to the next.
const FORGETTING: f64 = 0.99;

/// Minimum motion for a secant (m).
const LEAST_MOTION: f64 = 2e-5;

/// Stiffness of solids (N/m), and the maximum that is assumed when the instrument retracts.
const SOLID_STIFFNESS: f64 = 1e4;

/// Largest speed against a load (m/s). What is hit faster may be crushed before its force is seen.
pub(super) const FASTEST_TOUCH: f64 = 0.08;

/// Maximum retraction (m per period).
const RETREAT: f64 = 1e-3;

/// Tissue frames that an arm goes on at its speed before a stop has its effect: one until the next
/// chance to stop it, and one for its tracking error.
const STOPPING_FRAMES: f64 = 2.0;

/// The same for the strain of tissue, which speeds up where tissue is pressed on something hard.
const STRAIN_FRAMES: f64 = 3.0;

/// The force guard of one arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ForceGuard {
    /// Stiffness seen so far (N/m).
    stiffness: f64,
    /// Load (N) and tip position (m) at the end of the last frame.
    last: [DVec3; 2],
    /// Motion of the tip in the last frame (m).
    motion: DVec3,
    /// The tissue at the instrument then.
    tissue: TissueAtArm,
    /// Whether tissue soon is beyond the guard's limits if the motion goes on.
    strained: bool,
    /// Against what the instrument is about to hit too fast: a unit vector, or zero.
    hit: DVec3,
    /// Whether the force is beyond the limit and that was reported.
    reported: bool,
}

impl ForceGuard {
    /// At rest with the tip at `at` (m), without load.
    pub fn new(at: DVec3) -> Self {
        Self { last: [DVec3::ZERO, at], ..Self::default() }
    }

    /// Ends a tissue frame with the tip at `at` (m) under the forces (N) of `tissue`, which is
    /// strained, and of solids; `limit` is that of the force (N).
    pub fn end_frame(&mut self, [tissue, solid]: [DVec3; 2], strained: TissueAtArm, at: DVec3, limit: f64) {
        let (force, strain) = (tissue + solid, strained.share());
        let load = if limit.is_finite() && strain * limit > force.length() {
            strain * limit * force.normalize_or_zero()
        } else {
            force
        };
        let [was, there] = self.last;
        let (change, way) = (load - was, at - there);
        self.stiffness *= FORGETTING;
        if way.length() > LEAST_MOTION && load.length() > 0.0 {
            self.stiffness = self.stiffness.max(-change.dot(way) / way.length_squared());
        }
        if solid != DVec3::ZERO {
            self.stiffness = self.stiffness.max(SOLID_STIFFNESS);
        }
        let against = -way.dot(load.normalize_or_zero());
        self.strained = strained.will_exceed(&self.tissue, against, STRAIN_FRAMES);
        (self.last, self.motion, self.tissue) = ([load, at], way, strained);
        self.hit = DVec3::ZERO;
    }

    /// The motion of the tip in the last frame (m).
    pub fn motion(&self) -> DVec3 {
        self.motion
    }

    /// Says that the instrument is about to hit tissue too fast, and the unit vector against that;
    /// zero if it is not.
    pub fn expect(&mut self, hit: DVec3) {
        self.hit = hit;
    }

    /// The allowed part of a motion (m) that is commanded for the next `period` (s), so that the load
    /// stays below `limit` (N); the same motion if it is allowed whole. `way` begins at the arm's
    /// reference.
    pub fn allow(&self, way: DVec3, limit: f64, period: f64) -> DVec3 {
        if !limit.is_finite() {
            return way;
        }
        let fastest = FASTEST_TOUCH * period;
        let fast = (-way.dot(self.hit) - fastest).max(0.0);
        let way = if fast > 0.0 { way + fast * self.hit } else { way };
        let [load, _] = self.last;
        let size = load.length();
        if size == 0.0 {
            return way;
        }
        let out = load / size;
        let mut most = fastest;
        if size > FROM_SHARE * limit {
            let room = if (limit - size).abs() < DEADBAND * limit { 0.0 } else { limit - size };
            let stiffest = if room < 0.0 { SOLID_STIFFNESS } else { STIFFNESS[1] };
            // Beyond the limit this is negative: the minimum retraction.
            most = (GAIN * room / self.stiffness.clamp(STIFFNESS[0], stiffest)).clamp(-RETREAT, most);
        }
        let against = -way.dot(out);
        let allowed = against.min(most);
        let still = ((size / limit - 1.0) / (STILL_FROM - 1.0)).clamp(0.0, 1.0);
        if allowed == against && still == 0.0 {
            return way;
        }
        let aside = way + against * out;
        (1.0 - still) * aside - allowed * out
    }

    /// Whether the tissue at the instrument soon is strained beyond the guard's limits.
    pub fn sees_strain(&self) -> bool {
        self.strained
    }

    /// Whether the arm has to stop at once, because it goes against a load that would otherwise
    /// pass `limit` (N).
    pub fn must_stop(&self, limit: f64) -> bool {
        let [load, _] = self.last;
        let against = -self.motion.dot(load.normalize_or_zero());
        let ahead = self.stiffness.max(STIFFNESS[0]) * STOPPING_FRAMES * against;
        if limit.is_finite() && self.hit != DVec3::ZERO {
            return true;
        }
        let goes_on = self.strained || against > FASTEST_TOUCH * FRAME || load.length() + ahead > limit;
        limit.is_finite() && against > LEAST_MOTION && goes_on
    }

    /// Whether the `force` (N) has just gone beyond `limit` (N).
    pub fn newly_exceeded(&mut self, force: f64, limit: f64) -> Option<f64> {
        // Reported once, until the force is well below the limit.
        let over = force > if self.reported { 0.8 * limit } else { limit };
        let new = over && !self.reported;
        self.reported = over;
        new.then_some(force)
    }

    /// Every number of its state.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { stiffness, last: [load, at], motion, tissue, strained, hit, reported } = *self;
        let vectors = [load, at, motion, hit].map(|v| v.to_array());
        let flags = [strained, reported].map(|flag| f64::from(u8::from(flag)));
        vectors.into_iter().flatten().chain(tissue.numbers()).chain(flags).chain([stiffness])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1.0 / 30.0;

    /// Goes `speed` (m a period) into a wall of `stiffness` (N/m), the tip a share behind the
    /// command: forces of 300 periods (N).
    fn press(stiffness: f64, speed: f64, limit: f64) -> Vec<f64> {
        let (mut guard, mut command, mut tip) = (ForceGuard::default(), 0.01, 0.01_f64);
        let mut forces = Vec::new();
        for _ in 0..300 {
            let force = stiffness * (-tip).max(0.0);
            guard.end_frame([force * DVec3::X, DVec3::ZERO], TissueAtArm::default(), tip * DVec3::X, limit);
            if guard.must_stop(limit) {
                command = tip;
            }
            command += guard.allow(DVec3::new(-speed, 0.001, 0.0), limit, PERIOD).x;
            tip += 0.8 * (command - tip);
            forces.push(force);
        }
        forces
    }

    #[test]
    fn it_comes_to_the_limit_and_stays_there() {
        for stiffness in [500.0, 5e3, 2e4] {
            let forces = press(stiffness, 2e-4, 10.0);
            let last = &forces[280..];
            let peak = forces.iter().copied().fold(0.0, f64::max);
            assert!(last.iter().all(|f| (f - last[0]).abs() < 0.2), "{stiffness} N/m: {last:?}");
            assert!(peak < 12.0 && last[0] > 8.0, "{stiffness} N/m: a peak of {peak} N, then {} N", last[0]);
        }
        // A fast approach to stiff tissue is retracted.
        let forces = press(2e4, 1e-3, 10.0);
        assert!(forces[299] < 11.0, "{:?}", &forces[280..]);
    }

    #[test]
    fn what_goes_aside_or_away_is_let_go() {
        let mut guard = ForceGuard::default();
        guard.end_frame([9.5 * DVec3::Z, DVec3::ZERO], TissueAtArm::default(), DVec3::ZERO, 10.0);
        for way in [1e-3 * DVec3::X, 2e-3 * DVec3::Z] {
            assert_eq!(guard.allow(way, 10.0, PERIOD), way);
        }
        let slanted = guard.allow(DVec3::new(1e-3, 0.0, -1e-3), 10.0, PERIOD);
        assert!(slanted.x == 1e-3 && slanted.z > -1e-4 && slanted.z < 0.0, "{slanted}");
        assert_eq!(guard.allow(-1e-3 * DVec3::Z, 100.0, PERIOD), -1e-3 * DVec3::Z);
        guard.end_frame([30.0 * DVec3::Z, DVec3::ZERO], TissueAtArm::default(), DVec3::ZERO, 10.0);
        assert!(guard.allow(-1e-3 * DVec3::Z, 10.0, PERIOD).z > 0.0, "it draws back");
        assert_eq!((guard.newly_exceeded(30.0, 10.0), guard.newly_exceeded(30.0, 10.0)), (Some(30.0), None));
    }
}
