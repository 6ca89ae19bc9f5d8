//! Inverse kinematics: the posture for a pose of the flange.
//!
//! Levenberg-Marquardt with the damping of Sugihara (2011), which is smooth whether or not the pose
//! can be reached. An active set keeps the joints within their limits. The null-space motion of a
//! redundant arm goes towards a preferred posture and away from limits.

use super::arm::SerialArm;
use super::frames::Frames;
use super::joints::{JointSet, Joints, MAX_JOINTS};
use super::matrix::JointMatrix;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// Lever arm that weighs rotations against translations (m): about the length of an instrument.
pub(crate) const ROTATION_LEVER: f64 = 0.3;
/// Minimum damping (m2): singular values below its root are ignored.
const MIN_DAMPING: f64 = 1e-6;
/// Minimum factor of the damping, after successful steps.
const MIN_DAMPING_FACTOR: f64 = 1e-2;
/// Maximum motion of a joint in an iteration (rad or m).
const MAX_JOINT_STEP: f64 = 0.6;

/// Options of [`SerialArm::inverse`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseOptions {
    /// The preferred posture, which chooses the elbow. `None`: the arm's home posture.
    pub preferred: Option<Joints>,
    /// Distance from a limit at which joints are pushed away from it (rad or m).
    pub margin: f64,
    /// Tolerances of the flange: distance (m) and angle (rad) from its target.
    pub tolerance: [f64; 2],
    /// The search ends when the null-space motion of an iteration is smaller than this (rad or m).
    pub posture_tolerance: f64,
    /// Maximum number of iterations of one search.
    pub iterations: usize,
    /// Number of other starts if the first does not reach the target: the preferred posture, then
    /// postures throughout the range. Zero for a smooth motion.
    pub restarts: usize,
    /// No joint ends farther from its start than its maximum speed allows in this time (s).
    /// Infinite: no bound.
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

/// The result of a search. The flange is at `frames(q).flange()`, whether or not this is the
/// target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// The posture, within the limits (rad or m).
    pub q: Joints,
    /// Translation from the reached pose to the target, in world axes (m).
    pub translation: DVec3,
    /// Rotation from the reached pose to the target, as axis times angle in world axes (rad).
    pub rotation: DVec3,
    /// Whether both are within tolerance.
    pub reached: bool,
    /// Joints at a limit.
    pub at_limit: JointSet,
    /// Number of iterations, over all starts.
    pub iterations: usize,
}

impl Reached {
    /// Distance from the target (m), with the angle at [`ROTATION_LEVER`].
    fn cost(&self) -> f64 {
        (self.translation.length_squared() + (ROTATION_LEVER * self.rotation).length_squared()).sqrt()
    }
}

impl SerialArm {
    /// Searches for the posture whose flange is at `target` in the world, starting at `start`. If
    /// the pose cannot be reached, the result is the nearest posture found, with the remaining
    /// error.
    ///
    /// # Errors
    /// A target or start that is not finite, or another number of joints.
    pub fn inverse(&self, target: &Pose, start: &Joints, options: &InverseOptions) -> Result<Reached> {
        let unit = (target.rotation.length() - 1.0).abs() < 1e-3;
        if !(target.translation.is_finite() && unit && start.is_finite()) {
            let reason = "target and start must be finite, the target's rotation a unit quaternion";
            return Err(Error::invalid("inverse kinematics", reason));
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
            // Without the preference for a posture, which would lead all starts to the same place.
            let other = search.run(&if k == 0 { preferred } else { search.scattered(k) }, false);
            used += other.iterations;
            if other.reached {
                let preferred = search.run(&other.q, true);
                used += preferred.iterations;
                best = if preferred.reached { preferred } else { other };
            } else if other.cost() < best.cost() {
                best = other;
            }
        }
        Ok(Reached { iterations: used, ..best })
    }
}

/// The constants of a call.
struct Search<'a> {
    arm: &'a SerialArm,
    options: &'a InverseOptions,
    target: Pose,
    preferred: Joints,
    start: Joints,
}

/// Number of rows of the task: three of translation, three of rotation at [`ROTATION_LEVER`].
pub(crate) const TASK_ROWS: usize = 6;

impl Search<'_> {
    /// The allowed range of joint `i` (rad or m).
    fn range(&self, i: usize) -> [f64; 2] {
        let limits = &self.arm.segments()[i].joint.limits;
        let [low, high] = limits.position;
        let start = self.start[i].clamp(low, high);
        // Infinite speed times zero time is NaN: no bound.
        let way = limits.velocity * self.options.within.max(0.0);
        if way.is_finite() { [low.max(start - way), high.min(start + way)] } else { [low, high] }
    }

    /// Posture `k` of a Halton sequence over the range, with one prime a joint.
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

    /// The remaining error to the target: translation (m) and rotation (rad).
    fn missing(&self, frames: &Frames) -> (DVec3, DVec3) {
        let flange = frames.flange();
        (
            self.target.translation - flange.translation,
            rotation_vector(self.target.rotation * flange.rotation.inverse()),
        )
    }

    /// One descent. `elbow`: whether it uses the preferred posture.
    fn run(&self, from: &Joints, elbow: bool) -> Reached {
        let n = self.arm.dof();
        let ranges: [[f64; 2]; MAX_JOINTS] = std::array::from_fn(|i| if i < n { self.range(i) } else { [0.0; 2] });
        let mut q = Joints::from_fn(n, |i| from[i].clamp(ranges[i][0], ranges[i][1]));
        let mut frames = self.arm.frames(&q);
        let mut missing = self.missing(&frames);
        let [close, straight] = self.options.tolerance;
        let near = |m: &(DVec3, DVec3)| m.0.length() <= close && m.1.length() <= straight;
        let square = |m: &(DVec3, DVec3)| m.0.length_squared() + (ROTATION_LEVER * m.1).length_squared();
        let mut wishes = elbow;
        // Factor of the damping, which grows after a failed step; maximum step; number of steps
        // without much progress.
        let (mut caution, mut stride, mut stalled) = (1.0, MAX_JOINT_STEP, 0);
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
            // A null-space step may increase the error a little; the next step corrects it.
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
            stride = (2.0 * stride).min(MAX_JOINT_STEP);
            caution = f64::max(0.25 * caution, MIN_DAMPING_FACTOR);
            if stalled > 4 && wishes {
                // Near a singularity the preferred posture moves the flange. The pose has priority.
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

    /// The next step of the joints (rad or m), and the size of its null-space part.
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
        let mut rows = [Joints::zeros(n); TASK_ROWS];
        for i in 0..n {
            let (linear, angular) = (jacobian.linear[i], ROTATION_LEVER * jacobian.angular[i]);
            for a in 0..3 {
                rows[a][i] = linear[a];
                rows[3 + a][i] = angular[a];
            }
        }
        let angle = ROTATION_LEVER * missing.1;
        let error = [missing.0.x, missing.0.y, missing.0.z, angle.x, angle.y, angle.z];
        let square = error.iter().map(|e| e * e).sum::<f64>();
        let mut held = JointSet::default();
        let mut step = Joints::zeros(n);
        // The flange first. Each pass fixes at least one more joint at its bound.
        for _ in 0..=n {
            let mut left = error;
            for i in held.iter() {
                for (l, r) in left.iter_mut().zip(&rows) {
                    *l -= r[i] * step[i];
                }
            }
            let task = solve_task(&rows, held, left, caution * (MIN_DAMPING + 0.5 * square), 2);
            let mut over = false;
            for i in (0..n).filter(|&i| !held.contains(i)) {
                let [low, high] = ranges[i];
                step[i] = task[i];
                if !(q[i] + step[i] >= low && q[i] + step[i] <= high) {
                    step[i] = (q[i] + step[i]).clamp(low, high) - q[i];
                    held.insert(i);
                    over = true;
                    // Solves again for the other joints.
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
        // Then the null space, within the remaining range: the preferred posture must not move the
        // flange.
        let mut elbow = Joints::zeros(n);
        let room = |i: usize, way: f64| {
            let end = if way > 0.0 { ranges[i][1] } else { ranges[i][0] };
            (end - q[i] - step[i]) / way
        };
        for _ in 0..=n {
            let wanted = Joints::from_fn(n, |i| if held.contains(i) { 0.0 } else { self.preferred_motion(i, q[i]) });
            let moved: [f64; TASK_ROWS] = std::array::from_fn(|a| rows[a].dot(&wanted));
            let undo = solve_task(&rows, held, moved, MIN_DAMPING, 3);
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

    /// Preferred motion of joint `i`: half the way to the preferred posture, and away from a near
    /// limit (rad or m).
    fn preferred_motion(&self, i: usize, q: f64) -> f64 {
        let [low, high] = self.arm.segments()[i].joint.limits.position;
        let margin = self.options.margin.max(0.0).min(0.25 * (high - low));
        let off = (low + margin - q).max(0.0) - (q - (high - margin)).max(0.0);
        0.5 * (self.preferred[i] - q) + off
    }
}

/// J^T (J J^T + damping)^-1 e over the joints that are not held, refined `rounds - 1` times with
/// the residual (iterated Tikhonov), so that damping reduces accuracy only near singularities.
pub(crate) fn solve_task(
    rows: &[Joints; TASK_ROWS],
    held: JointSet,
    mut error: [f64; TASK_ROWS],
    damping: f64,
    rounds: usize,
) -> Joints {
    let n = rows[0].len();
    let mut free = *rows;
    for r in &mut free {
        held.iter().for_each(|i| r[i] = 0.0);
    }
    let mut gram = JointMatrix::zeros(TASK_ROWS);
    for a in 0..TASK_ROWS {
        for b in 0..=a {
            gram.set(a, b, free[a].dot(&free[b]));
        }
        gram.add_diagonal(a, damping);
    }
    let mut step = Joints::zeros(n);
    let Some(factor) = gram.factor() else { return step };
    for _ in 0..rounds {
        let y = factor.solve(&Joints::from_fn(TASK_ROWS, |a| error[a]));
        let part = Joints::from_fn(n, |i| (0..TASK_ROWS).map(|a| free[a][i] * y[a]).sum::<f64>());
        for i in 0..n {
            step[i] += part[i];
        }
        for (e, r) in error.iter_mut().zip(&free) {
            *e -= r.dot(&part);
        }
    }
    step
}

/// A rotation as axis times angle, with an angle of at most pi (rad).
pub(crate) fn rotation_vector(q: DQuat) -> DVec3 {
    let (v, w) = (DVec3::new(q.x, q.y, q.z), q.w);
    let (v, w) = if w < 0.0 { (-v, -w) } else { (v, w) };
    let s = v.length();
    if s < 1e-12 { 2.0 * v } else { v * (2.0 * libm::atan2(s, w) / s) }
}
