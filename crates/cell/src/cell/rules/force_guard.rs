//! Rule: no arm presses an instrument into tissue with more than the scene's force limit, and none
//! strains tissue beyond the limits that the other rules warn of.
//!
//! Controllers of real arms stop where the contact force is beyond a threshold; an FR3's is 20 N
//! for a tip in the open ("collision behaviour" in Franka's control interface). In tissue a stop is
//! not enough, because the pressure remains. So the guard does two things:
//!
//! - Commands, 30 times a second: the part of a motion against the load becomes shorter as the load
//!   nears the limit; beyond the limit the instrument retracts. Under a load of tissue the part
//!   aside becomes slow, because what lies beside may be harder. The motion is measured from the
//!   arm's reference, because commands are up to 20 mm ahead of a fast arm.
//! - Stops, 60 times a second: an arm that would pass the limit before the next chance to stop it
//!   stops at once, and so does one that is about to hit tissue fast ([`super::approach`]). A
//!   reference that stands or retreats is not stopped: a stop would undo the retreat.
//!
//! The stiffness seen so far limits each step, as in [`crate::Jaw`]: a fixed gain would oscillate
//! on stiff tissue or be slow on soft tissue.
//!
//! The load is the force on the instrument and the torque of tissue about its shaft, as a force at
//! a lever: an open jaw that rolls into tissue presses on it as one that is pushed does. So loads
//! and motions have four numbers. Where the strain of tissue is nearer to its limit than the force
//! is to the force limit, the load has that share of the limit.

use super::TissueAtArm;
use crate::FRAME;
use glam::{DVec3, DVec4};
use trocar_core::Wrench;

/// Lever at which a roll is a motion and the torque about the shaft a force (m): that of the tip of
/// an open blade.
const LEVER: f64 = 0.01;

/// Share of the remaining load that one step uses from [`FROM_SHARE`] on; all of it without a load.
const GAIN: f64 = 0.3;

/// From this share of the limit on commands have the smallest gain, and are slower aside.
const FROM_SHARE: f64 = 0.5;

/// Within this share of the limit the instrument stands still.
const DEADBAND: f64 = 0.02;

/// Minimum and maximum assumed stiffness of tissue (N/m).
const STIFFNESS: [f64; 2] = [2e3, 5e4];

/// Speed aside at the limit (m/s); beyond it there is none.
const CREEP: f64 = 0.01;

/// A motion of which more than this share goes away from the load is a retreat.
const MOSTLY: f64 = 0.5;

/// From this load on (N) the whole stiffness seen so far counts, below it a share: the secant of a
/// light touch over a short way says little, and would hold an arm that hardly presses.
const TRUSTED: f64 = 2.0;

/// Decay of the stiffness from one tissue frame to the next.
const FORGETTING: f64 = 0.99;

/// Minimum motion for a secant (m).
const LEAST_MOTION: f64 = 2e-5;

/// Stiffness of solids (N/m), and the maximum that is assumed when the instrument retracts.
const SOLID_STIFFNESS: f64 = 1e4;

/// Largest speed against a load (m/s). A faster hit may crush tissue before its force is seen.
pub(super) const FASTEST_TOUCH: f64 = 0.08;

/// Maximum retraction (m per period).
const RETREAT: f64 = 1e-3;

/// Number of tissue frames for which an arm keeps its speed before a stop has its effect: one until
/// the next chance to stop it, and one for its tracking error.
const STOPPING_FRAMES: f64 = 2.0;

/// The same for the strain of tissue, which speeds up where tissue is pressed on something hard.
const STRAIN_FRAMES: f64 = 3.0;

/// The force guard of one arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ForceGuard {
    /// Stiffness seen so far (N/m).
    stiffness: f64,
    /// Load (N) and place (m) at the end of the last frame.
    last: [DVec4; 2],
    /// Forces of tissue and of solids then (N). The load is larger than their sum where tissue is
    /// strained.
    forces: [DVec4; 2],
    /// Motion in the last frame (m).
    motion: DVec4,
    /// Place of the arm's reference at its end, and the reference's motion in it (m).
    reference: [DVec4; 2],
    /// Growth of the force in it (N); negative if it fell.
    rise: f64,
    /// The tissue at the instrument then.
    tissue: TissueAtArm,
    /// Whether the tissue will soon be beyond the guard's limits if the motion continues.
    strained: bool,
    /// Direction against the instrument if it is about to hit tissue too fast: a unit vector, or
    /// zero.
    hit: DVec3,
    /// Whether the force is beyond the limit and that was reported.
    reported: bool,
}

impl ForceGuard {
    /// At rest at `at` ([`place`]), without load.
    pub fn new(at: DVec4) -> Self {
        Self { last: [DVec4::ZERO, at], reference: [at, DVec4::ZERO], ..Self::default() }
    }

    /// Ends a tissue frame with the instrument `at` a place and the arm's reference at another,
    /// under the loads ([`load`]) of `tissue`, which is strained, and of solids; `limit` is that of
    /// the force (N).
    pub fn end_frame(
        &mut self,
        [tissue, solid]: [DVec4; 2],
        strained: TissueAtArm,
        [at, reference]: [DVec4; 2],
        limit: f64,
    ) {
        let (force, strain) = (tissue + solid, strained.share());
        let load = if limit.is_finite() && strain * limit > force.length() {
            strain * limit * force.normalize_or_zero()
        } else {
            force
        };
        let [_, there] = self.last;
        let was = self.forces[0] + self.forces[1];
        let (change, way) = (force - was, at - there);
        self.stiffness *= FORGETTING;
        if way.length() > LEAST_MOTION && force.length() > 0.0 {
            self.stiffness = self.stiffness.max(-change.dot(way) / way.length_squared());
        }
        if solid != DVec4::ZERO {
            self.stiffness = self.stiffness.max(SOLID_STIFFNESS);
        }
        let against = -way.dot(load.normalize_or_zero());
        self.strained = strained.will_exceed(&self.tissue, against, STRAIN_FRAMES);
        (self.last, self.motion, self.tissue) = ([load, at], way, strained);
        self.forces = [tissue, solid];
        self.rise = force.length() - was.length();
        self.reference = [reference, reference - self.reference[0]];
        self.hit = DVec3::ZERO;
    }

    /// The motion of the tip in the last frame (m).
    pub fn motion(&self) -> DVec3 {
        self.motion.truncate()
    }

    /// Says that the instrument is about to hit tissue too fast, and the unit vector against that;
    /// zero if it is not.
    pub fn expect(&mut self, hit: DVec3) {
        self.hit = hit;
    }

    /// The allowed part of a motion (m) that is commanded for the next `period` (s), so that the
    /// load stays below `limit` (N); the same motion if it is allowed whole. `way` begins at the
    /// arm's reference; a difference of places.
    pub fn allow(&self, way: DVec4, limit: f64, period: f64) -> DVec4 {
        if !limit.is_finite() {
            return way;
        }
        let fastest = FASTEST_TOUCH * period;
        let hit = self.hit.extend(0.0);
        let fast = (-way.dot(hit) - fastest).max(0.0);
        let way = if fast > 0.0 { way + fast * hit } else { way };
        let [load, _] = self.last;
        let size = load.length();
        if size == 0.0 {
            return way;
        }
        let out = load / size;
        let against = -way.dot(out);
        let mut aside = way + against * out;
        let room = if (limit - size).abs() < DEADBAND * limit { 0.0 } else { limit - size };
        let stiffest = if room < 0.0 { SOLID_STIFFNESS } else { STIFFNESS[1] };
        let gain = 1.0 - (1.0 - GAIN) * (size / (FROM_SHARE * limit)).min(1.0);
        // Beyond the limit this is negative: the minimum retraction.
        let most = (gain * room / self.stiffness_under_load().clamp(STIFFNESS[0], stiffest)).clamp(-RETREAT, fastest);
        let pressed = self.forces[0].length();
        if pressed > FROM_SHARE * limit {
            // Beside tissue that presses there may be harder tissue. Beyond the limit it only
            // retracts. Along a solid it slides: instruments that meet must get past each other.
            let left = (limit - pressed) / ((1.0 - FROM_SHARE) * limit);
            let speed = if left < -DEADBAND { 0.0 } else { CREEP + left.max(0.0) * (FASTEST_TOUCH - CREEP) };
            aside = aside.clamp_length_max(period * speed);
        }
        let allowed = against.min(most);
        if allowed == against && aside == way + against * out { way } else { aside - allowed * out }
    }

    /// The stiffness that counts under the present force (N/m).
    fn stiffness_under_load(&self) -> f64 {
        let [tissue, solid] = self.forces;
        self.stiffness * ((tissue + solid).length() / TRUSTED).powi(2).min(1.0)
    }

    /// Whether the tissue at the instrument soon is strained beyond the guard's limits.
    pub fn sees_strain(&self) -> bool {
        self.strained
    }

    /// Whether the arm has to stop at once: it moves against a load that would otherwise exceed
    /// `limit` (N).
    pub fn must_stop(&self, limit: f64) -> bool {
        if !limit.is_finite() {
            return false;
        }
        let ([load, _], [_, sent]) = (self.last, self.reference);
        let (size, out) = (load.length(), load.normalize_or_zero());
        let against = [self.motion, sent].map(|motion| -motion.dot(out));
        // A retreat is not stopped, and what stands need not be.
        if sent.length() <= LEAST_MOTION || against[1] < -MOSTLY * sent.length() {
            return self.hit != DVec3::ZERO;
        }
        let fastest = against[0].max(against[1]);
        let ahead = self.stiffness_under_load().max(STIFFNESS[0]) * fastest;
        let passes = size + STOPPING_FRAMES * ahead.max(self.rise) > limit;
        let goes_on = self.strained || fastest > FASTEST_TOUCH * FRAME;
        self.hit != DVec3::ZERO || passes || against[1] > LEAST_MOTION && goes_on
    }

    /// Whether the `force` (N) has just exceeded `limit` (N).
    pub fn newly_exceeded(&mut self, force: f64, limit: f64) -> Option<f64> {
        // Reported once, until the force is well below the limit.
        let over = force > if self.reported { 0.8 * limit } else { limit };
        let new = over && !self.reported;
        self.reported = over;
        new.then_some(force)
    }

    /// Every number of its state.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self {
            stiffness,
            last: [load, at],
            forces: [tissue_force, solid_force],
            motion,
            reference: [sent, moved],
            rise,
            tissue,
            strained,
            hit,
            reported,
        } = *self;
        let vectors = [load, at, tissue_force, solid_force, motion, sent, moved].map(|v| v.to_array());
        let flags = [strained, reported].map(|flag| f64::from(u8::from(flag)));
        let vectors = vectors.into_iter().flatten().chain(hit.to_array());
        vectors.chain(tissue.numbers()).chain(flags).chain([stiffness, rise])
    }
}

/// The place (m) of an instrument with its tip at `tip` (m), rolled by `roll` (rad).
pub(in crate::cell) fn place(tip: DVec3, roll: f64) -> DVec4 {
    tip.extend(LEVER * roll)
}

/// The tip (m) and the roll (rad) of a place.
pub(in crate::cell) fn tip_and_roll(place: DVec4) -> (DVec3, f64) {
    (place.truncate(), place.w / LEVER)
}

/// The load (N) of a `wrench` about the tip of an instrument along the unit vector `shaft`.
pub(in crate::cell) fn load(wrench: Wrench, shaft: DVec3) -> DVec4 {
    wrench.force.extend(wrench.torque.dot(shaft) / LEVER)
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
            let places = [tip, command].map(|x| x * DVec4::X);
            guard.end_frame([force * DVec4::X, DVec4::ZERO], TissueAtArm::default(), places, limit);
            if guard.must_stop(limit) {
                command = tip;
            }
            command += guard.allow(DVec4::new(-speed, 0.001, 0.0, 0.0), limit, PERIOD).x;
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

    /// A guard under a `load` (N) that it has not met before.
    fn under(load: DVec4) -> ForceGuard {
        let mut guard = ForceGuard::default();
        guard.end_frame([load, DVec4::ZERO], TissueAtArm::default(), [DVec4::ZERO; 2], 10.0);
        guard
    }

    #[test]
    fn what_goes_away_is_let_go_and_what_goes_aside_becomes_slow() {
        let (away, aside) = (2e-3 * DVec4::Z, 1e-3 * DVec4::X);
        for load in [3.0, 9.5, 30.0] {
            assert_eq!(under(load * DVec4::Z).allow(away, 10.0, PERIOD), away);
        }
        assert_eq!(under(3.0 * DVec4::Z).allow(aside, 10.0, PERIOD), aside);
        let slanted = under(9.5 * DVec4::Z).allow(aside - 1e-3 * DVec4::Z, 10.0, PERIOD);
        assert!(slanted.x > 3e-4 && slanted.x < 7e-4 && slanted.z > -1e-4 && slanted.z < 0.0, "{slanted}");
        assert_eq!(under(9.5 * DVec4::Z).allow(-1e-3 * DVec4::Z, 100.0, PERIOD), -1e-3 * DVec4::Z);
        assert!(under(30.0 * DVec4::Z).allow(-1e-3 * DVec4::Z, 10.0, PERIOD).z > 0.0, "it draws back");
        let mut guard = under(30.0 * DVec4::Z);
        assert_eq!((guard.newly_exceeded(30.0, 10.0), guard.newly_exceeded(30.0, 10.0)), (Some(30.0), None));
    }

    #[test]
    fn a_roll_that_presses_is_a_load_too() {
        let shaft = DVec3::Z;
        // 12 N at an open blade's tip against a positive roll, and as much the other way at the
        // shaft.
        let torque = load(Wrench { force: DVec3::ZERO, torque: -0.12 * shaft }, shaft);
        let wanted = place(DVec3::ZERO, 0.05);
        let (tip, roll) = tip_and_roll(under(torque).allow(wanted, 10.0, PERIOD));
        assert!(tip == DVec3::ZERO && roll < 0.0, "it turns back: {roll} rad");
        let (_, free) = tip_and_roll(under(DVec4::X).allow(wanted, 10.0, PERIOD));
        assert!((free - 0.05).abs() < 1e-12, "{free} rad");
    }

    #[test]
    fn a_retreat_goes_on_and_an_advance_stops() {
        // Beyond the limit, and the instrument still comes nearer by a tenth of a millimetre a
        // frame.
        let stops = |sent: DVec4| {
            let mut guard = ForceGuard::default();
            for frame in 0..2 {
                let places = [-1e-4 * f64::from(frame) * DVec4::Z, f64::from(frame) * sent];
                guard.end_frame([15.0 * DVec4::Z, DVec4::ZERO], TissueAtArm::default(), places, 10.0);
            }
            guard.must_stop(10.0)
        };
        assert!(stops(-1e-4 * DVec4::Z) && stops(1e-4 * DVec4::X), "it goes on against the load, or aside");
        assert!(!stops(1e-4 * DVec4::Z), "the retreat is not undone");
        assert!(!stops(DVec4::ZERO), "it stands");
    }
}
