//! Inverse kinematics: the posture that brings the flange to a pose.
//!
//! Levenberg-Marquardt with the damping of Sugihara (2011), which is smooth whether or not the pose can be reached, in the joints' box by an active
//! set; the motion that leaves the flange where it is (a seventh joint's) goes towards a preferred posture and away from limits.

use super::arm::SerialArm;
use super::frames::Frames;
use super::joints::{JointSet, Joints};
use super::matrix::JointMatrix;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// Rotations are weighed against translations as if at this distance [m]: about an instrument's length.
pub(crate) const LEVER: f64 = 0.3;
/// Damping that is always there [m2]: singular values below its root are not trusted.
const FLOOR: f64 = 1e-6;
/// The least share of the damping, after steps that went well.
const CAUTION: f64 = 1e-2;
/// No joint moves further in one iteration [rad or m].
const STRIDE: f64 = 0.6;

/// How [`SerialArm::inverse`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseOptions {
    /// Where the joints would like to be: it chooses the elbow. `None`: the arm's home.
    pub preferred: Option<Joints>,
    /// Joints are pushed off their limits from this far away [rad or m].
    pub margin: f64,
    /// Good enough: distance [m] and angle [rad] of the flange from its target.
    pub tolerance: [f64; 2],
    /// The elbow is left alone when it would move less than this in an iteration [rad or m].
    pub posture_tolerance: f64,
    /// Most iterations of one search.
    pub iterations: usize,
    /// Other starts that are tried where the first does not reach the target: the preferred posture, then postures all over the range. Zero for
    /// a smooth motion.
    pub restarts: usize,
    /// No joint ends further from its start than its highest speed takes it in this time [s]. Infinite: no bound.
    pub within: f64,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            preferred: None,
            margin: 0.1,
            tolerance: [1e-8, 1e-8],
            posture_tolerance: 1e-4,
            iterations: 60,
            restarts: 0,
            within: f64::INFINITY,
        }
    }
}

/// What a search came to. The flange is at `frames(q).flange()`, whatever was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// The posture, within its limits.
    pub q: Joints,
    /// From the flange reached to its target, in world axes [m].
    pub translation: DVec3,
    /// The turn from the flange reached to its target, as axis times angle in world axes [rad].
    pub rotation: DVec3,
    /// Whether both are within tolerance.
    pub reached: bool,
    /// Joints that are at a limit.
    pub at_limit: JointSet,
    /// Iterations used, over all starts.
    pub iterations: usize,
}

impl Reached {
    /// Distance from the target [m], the angle at a lever of 0.3 m included.
    fn cost(&self) -> f64 {
        (self.translation.length_squared() + (LEVER * self.rotation).length_squared()).sqrt()
    }
}

impl SerialArm {
    /// Looks for the posture whose flange is at `target` in the world, from the posture `start` on. Never fails to answer: where the pose cannot
    /// be reached, the nearest posture that was found comes with what is missing.
    ///
    /// # Errors
    /// A target or start that is not finite, or not a number a joint.
    pub fn inverse(&self, target: &Pose, start: &Joints, options: &InverseOptions) -> Result<Reached> {
        let unit = (target.rotation.length() - 1.0).abs() < 1e-3;
        if !(target.translation.is_finite() && unit && start.is_finite()) {
            return Err(Error::NotFinite {
                what: "the target pose or the start, or the target's rotation is no rotation:",
            });
        }
        let preferred = options.preferred.unwrap_or(self.home());
        if start.len() != self.dof() || preferred.len() != self.dof() || !preferred.is_finite() {
            let reason = format!("start and preferred posture must have {} finite numbers", self.dof());
            return Err(Error::invalid("inverse kinematics", reason));
        }
        let target = Pose { rotation: target.rotation.normalize(), ..*target };
        let search = Search { arm: self, options, target, preferred, start: *start };
        let mut best = search.run(start, true);
        let mut used = best.iterations;
        for k in 0..options.restarts {
            if best.reached {
                break;
            }
            // The pose first, whatever the elbow: its wish would lead all starts to the same place.
            let other = search.run(&if k == 0 { preferred } else { search.scattered(k) }, false);
            used += other.iterations;
            if other.reached {
                let nicer = search.run(&other.q, true);
                used += nicer.iterations;
                best = if nicer.reached { nicer } else { other };
            } else if other.cost() < best.cost() {
                best = other;
            }
        }
        Ok(Reached { iterations: used, ..best })
    }
}

/// One call's constants.
struct Search<'a> {
    arm: &'a SerialArm,
    options: &'a InverseOptions,
    target: Pose,
    preferred: Joints,
    start: Joints,
}

/// The rows of the task: three of translation, three of rotation at the lever's length.
pub(crate) const TASK: usize = 6;

impl Search<'_> {
    /// The range that joint `i` may be in.
    fn range(&self, i: usize) -> [f64; 2] {
        let limits = &self.arm.segments()[i].joint.limits;
        let [low, high] = limits.position;
        let start = self.start[i].clamp(low, high);
        // Infinite speed in no time is no bound.
        let way = limits.velocity * self.options.within.max(0.0);
        if way.is_finite() { [low.max(start - way), high.min(start + way)] } else { [low, high] }
    }

    /// A posture far from others: Halton's sequence over the range, a prime a joint.
    fn scattered(&self, k: usize) -> Joints {
        const PRIMES: [usize; 16] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];
        Joints::from_fn(self.arm.dof(), |i| {
            let (mut x, mut share, mut rest) = (0.0, 1.0, k);
            while rest > 0 {
                share /= PRIMES[i] as f64;
                x += share * (rest % PRIMES[i]) as f64;
                rest /= PRIMES[i];
            }
            let [low, high] = self.range(i);
            let (low, high) = (low.max(-std::f64::consts::PI), high.min(std::f64::consts::PI));
            low + x * (high - low)
        })
    }

    /// What is missing to the target: translation [m] and turn [rad].
    fn missing(&self, frames: &Frames) -> (DVec3, DVec3) {
        let flange = frames.flange();
        (self.target.translation - flange.translation, turn(self.target.rotation * flange.rotation.inverse()))
    }

    /// One descent; `elbow`: whether the preferred posture counts.
    fn run(&self, from: &Joints, elbow: bool) -> Reached {
        let n = self.arm.dof();
        let ranges: [[f64; 2]; super::MAX_JOINTS] =
            std::array::from_fn(|i| if i < n { self.range(i) } else { [0.0; 2] });
        let mut q = Joints::from_fn(n, |i| from[i].clamp(ranges[i][0], ranges[i][1]));
        let mut frames = self.arm.frames(&q);
        let mut missing = self.missing(&frames);
        let [close, straight] = self.options.tolerance;
        let near = |m: &(DVec3, DVec3)| m.0.length() <= close && m.1.length() <= straight;
        let square = |m: &(DVec3, DVec3)| m.0.length_squared() + (LEVER * m.1).length_squared();
        let mut wishes = elbow;
        // How much shorter than usual the steps are to be, after one that led away; and for how many none came much nearer.
        let (mut caution, mut stride, mut stalled) = (1.0, STRIDE, 0);
        let mut iterations = 0;
        while iterations < self.options.iterations {
            iterations += 1;
            let (mut step, still) = self.advance(&q, &frames, &missing, &ranges, caution, wishes);
            if near(&missing) && still <= self.options.posture_tolerance {
                break;
            }
            let longest = step.max_abs();
            if longest < 1e-12 {
                break;
            }
            if longest > stride {
                step.iter_mut().for_each(|s| *s *= stride / longest);
            }
            let new = Joints::from_fn(n, |i| (q[i] + step[i]).clamp(ranges[i][0], ranges[i][1]));
            let new_frames = self.arm.frames(&new);
            let new_missing = self.missing(&new_frames);
            let (before, after) = (square(&missing), square(&new_missing));
            // A step of the elbow may cost a little, which the next one makes good.
            let costs = if wishes { 1e-2 * longest.min(stride).powi(2) } else { 0.0 };
            if after > before + costs && !near(&new_missing) {
                stride = (0.35 * longest.min(stride)).max(1e-6);
                caution *= 8.0;
                if caution > 1e9 {
                    break;
                }
                continue;
            }
            stalled = if after > 0.8 * before && !near(&new_missing) { stalled + 1 } else { 0 };
            (q, frames, missing) = (new, new_frames, new_missing);
            stride = (2.0 * stride).min(STRIDE);
            caution = f64::max(0.25 * caution, CAUTION);
            if stalled > 4 && wishes {
                // Near a singularity the wish pulls the flange along; the pose comes first.
                (wishes, stalled) = (false, 0);
            } else if stalled > 12 {
                break;
            }
        }
        let mut at_limit = JointSet::default();
        for i in 0..n {
            let [low, high] = self.arm.segments()[i].joint.limits.position;
            if q[i] - low < 1e-9 || high - q[i] < 1e-9 {
                at_limit.insert(i);
            }
        }
        let reached = near(&missing);
        Reached { q, translation: missing.0, rotation: missing.1, reached, at_limit, iterations }
    }

    /// The next step of the joints, and how far it moves them without moving the flange.
    fn advance(
        &self,
        q: &Joints,
        frames: &Frames,
        missing: &(DVec3, DVec3),
        ranges: &[[f64; 2]],
        caution: f64,
        wishes: bool,
    ) -> (Joints, f64) {
        let n = q.len();
        let jacobian = frames.flange_jacobian();
        let mut rows = [Joints::zeros(n); TASK];
        for i in 0..n {
            let (linear, angular) = (jacobian.linear[i], LEVER * jacobian.angular[i]);
            for a in 0..3 {
                rows[a][i] = linear[a];
                rows[3 + a][i] = angular[a];
            }
        }
        let turn = LEVER * missing.1;
        let error = [missing.0.x, missing.0.y, missing.0.z, turn.x, turn.y, turn.z];
        let square = error.iter().map(|e| e * e).sum::<f64>();
        let mut held = JointSet::default();
        let mut step = Joints::zeros(n);
        // The flange first. Each pass holds at least one more joint at its bound.
        for _ in 0..=n {
            let mut left = error;
            for i in held.iter() {
                for (l, r) in left.iter_mut().zip(&rows) {
                    *l -= r[i] * step[i];
                }
            }
            let task = solve(&rows, held, left, caution * (FLOOR + 0.5 * square), 2);
            let mut over = false;
            for i in (0..n).filter(|&i| !held.contains(i)) {
                let [low, high] = ranges[i];
                step[i] = task[i];
                if !(q[i] + step[i] >= low && q[i] + step[i] <= high) {
                    step[i] = (q[i] + step[i]).clamp(low, high) - q[i];
                    held.insert(i);
                    over = true;
                    // The others anew, without it.
                    break;
                }
            }
            if !over {
                break;
            }
        }
        if !wishes {
            return (step, 0.0);
        }
        // Then what leaves it in place, as far as the room that is left allows: a wish must never push the flange away.
        let mut elbow = Joints::zeros(n);
        let room = |i: usize, way: f64| {
            let end = if way > 0.0 { ranges[i][1] } else { ranges[i][0] };
            (end - q[i] - step[i]) / way
        };
        for _ in 0..=n {
            let wanted = Joints::from_fn(n, |i| if held.contains(i) { 0.0 } else { self.wish(i, q[i]) });
            let moved: [f64; TASK] = std::array::from_fn(|a| rows[a].dot(&wanted));
            let undo = solve(&rows, held, moved, FLOOR, 3);
            elbow = Joints::from_fn(n, |i| wanted[i] - undo[i]);
            let before = held;
            for i in 0..n {
                if elbow[i].abs() > 1e-12 && room(i, elbow[i]) < 1e-3 {
                    held.insert(i);
                }
            }
            if held == before {
                break;
            }
        }
        let share = (0..n).filter(|&i| elbow[i].abs() > 1e-12).fold(1.0, |s: f64, i| s.min(room(i, elbow[i])));
        for i in 0..n {
            elbow[i] *= share.max(0.0);
            step[i] += elbow[i];
        }
        (step, elbow.max_abs())
    }

    /// Where joint `i` would go if it were free: half way to the preferred posture, and off a limit that is near.
    fn wish(&self, i: usize, q: f64) -> f64 {
        let [low, high] = self.arm.segments()[i].joint.limits.position;
        let margin = self.options.margin.max(0.0).min(0.25 * (high - low));
        let off = (low + margin - q).max(0.0) - (q - (high - margin)).max(0.0);
        0.5 * (self.preferred[i] - q) + off
    }
}

/// J^T (J J^T + damping)^-1 e over the joints that are not held, made better `rounds - 1` times with what is still missing (iterated
/// Tikhonov), so that damping costs accuracy only where the arm is singular.
pub(crate) fn solve(
    rows: &[Joints; TASK],
    held: JointSet,
    mut error: [f64; TASK],
    damping: f64,
    rounds: usize,
) -> Joints {
    let n = rows[0].len();
    let mut free = *rows;
    for r in &mut free {
        held.iter().for_each(|i| r[i] = 0.0);
    }
    let mut gram = JointMatrix::zeros(TASK);
    for a in 0..TASK {
        for b in 0..=a {
            gram.set(a, b, free[a].dot(&free[b]));
        }
        gram.add_diagonal(a, damping);
    }
    let mut step = Joints::zeros(n);
    let Some(factor) = gram.factor() else { return step };
    for _ in 0..rounds {
        let y = factor.solve(&Joints::from_fn(TASK, |a| error[a]));
        let part = Joints::from_fn(n, |i| (0..TASK).map(|a| free[a][i] * y[a]).sum::<f64>());
        for i in 0..n {
            step[i] += part[i];
        }
        for (e, r) in error.iter_mut().zip(&free) {
            *e -= r.dot(&part);
        }
    }
    step
}

/// A rotation as axis times angle, the short way [rad].
pub(crate) fn turn(q: DQuat) -> DVec3 {
    let (v, w) = (DVec3::new(q.x, q.y, q.z), q.w);
    let (v, w) = if w < 0.0 { (-v, -w) } else { (v, w) };
    let s = v.length();
    if s < 1e-12 { 2.0 * v } else { v * (2.0 * s.atan2(w) / s) }
}
