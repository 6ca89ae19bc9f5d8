//! The reference: a smooth motion of the joints from commands thirty times a second.
//!
//! Commands pass through two filters. First a *limiter*, once a command: the next control point
//! moves towards the command within the limits of speed and acceleration, and equals a command that
//! is slow enough. Then a uniform quadratic B-spline through the control points: the reference's
//! speed is continuous, its acceleration is bounded, and it follows a steady command steadily. The
//! spline is 1.5 command periods (50 ms) behind a signal whose samples are the commands, and one
//! (33 ms) behind the mean of the held commands.
//!
//! The spline runs in the instrument's coordinates. So the shaft's axis passes the port's centre at
//! every instant, not only at the commands. The joints follow by one or two Newton steps a physics
//! step; the null space drifts towards the arm's home posture and away from limits. If the arm
//! cannot follow (a joint at a limit or too fast), the spline's time slows down or stops.

use crate::chain::{Joints, ROTATION_LEVER, SerialArm, TASK_ROWS, rotation_vector, solve_task};
use crate::instrument::{Coordinates, Instrument, Limits, coordinates};
use crate::port::Port;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_core::Pose;
use trocar_core::interpolate::linear;

/// Maximum speed and acceleration of the control points: two pivots (rad/s, rad/s2), insertion
/// (m/s, m/s2), roll (rad/s, rad/s2). Slower commands pass unchanged.
const COORDINATE_LIMITS: [[f64; 2]; 4] = [[0.6, 3.0], [0.6, 3.0], [0.15, 1.0], [2.0, 10.0]];
/// Maximum share of a joint's maximum speed in the reference.
const SPEED_SHARE: f64 = 0.5;
/// Deceleration of joints towards their limits (rad/s2 or m/s2).
const BRAKING: f64 = 8.0;
/// Time in which the spline recovers its full pace (s).
const RECOVERY: f64 = 0.3;
/// Pace below which the spline stops.
const STANDSTILL: f64 = 0.04;
/// Pace below which the joints' maximum speeds decrease with it: a nearly stretched arm comes to
/// rest before its end.
const EASE_BELOW: f64 = 0.7;
/// Maximum acceleration of a joint of the reference (rad/s2 or m/s2), far above that of motions
/// away from singular postures.
const MAX_JOINT_ACCELERATION: f64 = 25.0;
/// Acceleration of joint commands if the arm has no limit (rad/s2 or m/s2).
const JOINT_ACCELERATION: f64 = 10.0;
/// Rounding error of a sum of steps, as a share of a period.
const ROUNDING: f64 = 1e-9;
/// Tolerance of the flange's pose (m, with angles at a lever).
const POSE_TOLERANCE: f64 = 1e-9;
/// Pose error above which the arm does not reach the pose (m).
const MAX_POSE_ERROR: f64 = 2e-6;
/// Rate of the null-space drift (1/s).
const DRIFT_RATE: f64 = 4.0;
/// Speed of the instrument at which the drift has its full rate (coordinates a second, insertions
/// times five). It drifts only while the instrument moves, because a joint that creeps while the
/// instrument rests would stick and slip.
const DRIFT_FULL_SPEED: f64 = 0.02;
/// Distance from a limit at which joints are pushed away from it (rad or m).
const LIMIT_MARGIN: f64 = 0.1;
/// Minimum distance of the reference's joints from their limits (rad or m), as a margin for the
/// arm's tracking error.
const LIMIT_DISTANCE: f64 = 5e-3;

/// The kind of command: coordinates in the port, or joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Goal {
    Coordinates,
    Joints,
}

/// The state of the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Reference {
    goal: Goal,
    /// The last command: four coordinates or the joints.
    pub target: Joints,
    /// The command at the last control point.
    previous: Joints,
    points: [Joints; 3],
    /// Time since the last control point (s).
    phase: f64,
    /// The current value of the spline.
    pub value: Joints,
    /// The current posture (rad or m).
    pub q: Joints,
    /// Its rate over the last step (rad/s or m/s).
    pub qd: Joints,
    /// Acceleration over the last step (rad/s2 or m/s2).
    pub qdd: Joints,
    /// Pace of the spline's time in the last step: 1 if the arm could follow.
    pub pace: f64,
}

impl Reference {
    pub fn numbers(&self) -> Vec<f64> {
        let Self { goal, target, previous, points: [a, b, c], phase, value, q, qd, qdd, pace } = self;
        let goal = f64::from(u8::from(*goal == Goal::Joints));
        let joints = [target, previous, a, b, c, value, q, qd, qdd];
        joints.into_iter().flat_map(|joints| joints.iter().copied()).chain([goal, *phase, *pace]).collect()
    }
}

/// The constants of a reference.
pub(super) struct ReferenceContext<'a> {
    pub arm: &'a SerialArm,
    pub instrument: &'a Instrument,
    pub port: &'a Port,
    pub limits: &'a Limits,
    pub period: f64,
}

/// The four coordinates without the jaw as a vector.
pub(super) fn pack(c: &Coordinates) -> Joints {
    let a = c.to_action();
    Joints::from_fn(4, |i| a[i])
}

/// The inverse of [`pack`], with `jaw`.
pub(super) fn unpack(v: &Joints, jaw: f64) -> Coordinates {
    Coordinates { pivots: [v.at(0), v.at(1)], insertion: v.at(2), roll: v.at(3), jaw }
}

impl Reference {
    /// At rest in the posture `q` at the coordinates `at`.
    pub fn at_rest(q: Joints, at: &Coordinates, period: f64) -> Self {
        let (value, still) = (pack(at), Joints::zeros(q.len()));
        let points = [value; 3];
        let goal = Goal::Coordinates;
        Self { goal, target: value, previous: value, points, phase: period, value, q, qd: still, qdd: still, pace: 1.0 }
    }

    /// Whether the last command was of joints.
    pub fn in_joints(&self) -> bool {
        self.goal == Goal::Joints
    }

    /// Commands coordinates. `now` are those of the reference, used after a command of joints.
    pub fn command_coordinates(&mut self, target: &Coordinates, now: &Coordinates) {
        if self.goal == Goal::Joints {
            let value = pack(now);
            (self.goal, self.points, self.value, self.previous) = (Goal::Coordinates, [value; 3], value, value);
        }
        self.target = pack(target);
    }

    /// Commands joints. The reference keeps its speed.
    pub fn command_joints(&mut self, target: &Joints, period: f64) {
        if self.goal == Goal::Coordinates {
            let (q, qd) = (self.q, self.qd);
            let beside = |s: f64| Joints::from_fn(q.len(), |i| q[i] + s * period * qd[i]);
            (self.goal, self.value, self.previous) = (Goal::Joints, q, q);
            // The next control point follows at once.
            (self.points, self.phase) = ([beside(-1.0), beside(-0.5), beside(0.5)], period);
        }
        self.target = *target;
    }

    /// Stops at the present place, which becomes the target.
    pub fn halt(&mut self, period: f64) {
        let (value, still) = (self.value, Joints::zeros(self.q.len()));
        // Without its rates the controller asks for no torque ahead of the stop.
        (self.qd, self.qdd) = (still, still);
        (self.target, self.previous, self.points, self.phase) = (value, value, [value; 3], period);
    }

    pub fn advance(&mut self, context: &ReferenceContext<'_>, dt: f64) {
        let (before, rate) = (*self, self.qd);
        let mut pace = (before.pace + dt / RECOVERY).min(1.0);
        let ease = (before.pace / EASE_BELOW).min(1.0);
        // First at the possible pace, then slowed down as the joints need, then stopped.
        for attempt in 0..3 {
            let stands = attempt == 2 || pace < STANDSTILL;
            *self = before;
            self.pace = if stands { 0.0 } else { pace };
            if stands {
                // The next step starts from rest.
                (self.points, self.phase) = ([self.value; 3], context.period);
            } else {
                self.run(context, pace * dt);
            }
            let (wanted, far) = self.posture(context, &before, dt);
            let mut slower: f64 = 1.0;
            for (i, s) in context.arm.segments().iter().enumerate() {
                let (from, way) = (before.q[i], wanted[i] - before.q[i]);
                let [low, high] = s.joint.limits.position;
                let keep = LIMIT_DISTANCE.min(0.25 * (high - low));
                let room = if way > 0.0 { high - keep - from } else { from - low - keep };
                let had = (rate[i] * way.signum()).max(0.0);
                let fastest = (2.0 * BRAKING * room.max(0.0))
                    .sqrt()
                    .min(ease * SPEED_SHARE * s.joint.limits.velocity)
                    .min(had + MAX_JOINT_ACCELERATION * dt);
                if way.abs() > fastest * dt {
                    slower = slower.min(fastest * dt / way.abs());
                }
            }
            // Excess speed in the second attempt comes from the path's curvature.
            if stands || (far < MAX_POSE_ERROR && (slower == 1.0 || attempt == 1)) {
                for (i, s) in context.arm.segments().iter().enumerate() {
                    let [low, high] = s.joint.limits.position;
                    self.q[i] = (before.q[i] + slower * (wanted[i] - before.q[i])).clamp(low, high);
                }
                if stands {
                    self.pace = 2.0 * STANDSTILL;
                }
                break;
            }
            pace = if far < MAX_POSE_ERROR { slower * pace } else { 0.0 };
        }
        for i in 0..self.q.len() {
            self.qd[i] = (self.q[i] - before.q[i]) / dt;
            self.qdd[i] = (self.qd[i] - rate[i]) / dt;
        }
    }

    /// Advances the spline.
    fn run(&mut self, context: &ReferenceContext<'_>, time: f64) {
        let period = context.period;
        // A control point is computed in the first step after its time, in order to include a
        // command in between.
        while self.phase >= period * (1.0 - ROUNDING) {
            self.shift(context);
        }
        self.phase += time;
        while self.phase > period * (1.0 + ROUNDING) {
            self.shift(context);
        }
        let u = (self.phase / period).clamp(0.0, 1.0);
        let w = [0.5 * (1.0 - u) * (1.0 - u), 0.5 + u - u * u, 0.5 * u * u];
        let [a, b, c] = &self.points;
        self.value = Joints::from_fn(a.len(), |i| w[0] * a[i] + w[1] * b[i] + w[2] * c[i]);
    }

    fn shift(&mut self, context: &ReferenceContext<'_>) {
        self.phase -= context.period;
        let next = self.next(context);
        self.points = [self.points[1], self.points[2], next];
        self.previous = self.target;
    }

    /// The next control point.
    fn next(&self, context: &ReferenceContext<'_>) -> Joints {
        let (period, [_, before, last]) = (context.period, &self.points);
        let next = Joints::from_fn(last.len(), |i| {
            let [speed, acceleration] = match self.goal {
                Goal::Coordinates => COORDINATE_LIMITS[i.min(3)],
                Goal::Joints => {
                    let limits = &context.arm.segments()[i].joint.limits;
                    [SPEED_SHARE * limits.velocity, limits.acceleration.min(JOINT_ACCELERATION)]
                }
            };
            let (left, step) = (self.target.at(i) - last[i], last[i] - before[i]);
            let moves = self.target.at(i) - self.previous.at(i);
            // The reference need not stop at a target that moves away.
            let away = if moves * left > 0.0 { moves.abs().min(left.abs()) } else { 0.0 };
            // The maximum speed from which it can stop at the target, in steps of a period.
            let half = 0.5 * acceleration * period;
            let most = ((half * half + 2.0 * acceleration * left.abs()).sqrt() - half) * period + away;
            let most = most.min(speed * period);
            let change = acceleration * period * period;
            last[i] + left.clamp(-most, most).clamp(step - change, step + change)
        });
        match self.goal {
            Goal::Coordinates => pack(&context.limits.clamp(&unpack(&next, 0.0)).0),
            Goal::Joints => Joints::from_fn(next.len(), |i| {
                let [low, high] = context.arm.segments()[i].joint.limits.position;
                next[i].clamp(low, high)
            }),
        }
    }

    /// The posture for the spline's value, and the pose error of its flange (m).
    fn posture(&self, context: &ReferenceContext<'_>, before: &Self, dt: f64) -> (Joints, f64) {
        if self.goal == Goal::Joints {
            return (self.value, 0.0);
        }
        let n = self.q.len();
        let target = context.port.flange(context.instrument, &unpack(&self.value, 0.0));
        let mut q = before.q;
        let mut far = f64::INFINITY;
        let speed = |i: usize| (self.value.at(i) - before.value.at(i)).abs() / dt;
        let fastest = speed(0).max(speed(1)).max(5.0 * speed(2)).max(speed(3));
        let drifts = dt * (fastest / DRIFT_FULL_SPEED).min(1.0);
        for round in 0..3 {
            let (step, distance) = newton(context.arm, &q, &target, (round == 0 && drifts > 0.0).then_some(drifts));
            far = distance;
            if round > 0 && distance < POSE_TOLERANCE {
                break;
            }
            for i in 0..n {
                q[i] += step[i];
            }
        }
        (q, far)
    }
}

/// The joint step towards a pose of the flange, with null-space drift over `drifts` (s), and the
/// pose error of the flange (m).
fn newton(arm: &SerialArm, q: &Joints, target: &Pose, drifts: Option<f64>) -> (Joints, f64) {
    let n = q.len();
    let frames = arm.frames(q);
    let flange = frames.flange();
    let (away, angle) = (
        target.translation - flange.translation,
        ROTATION_LEVER * rotation_vector(target.rotation * flange.rotation.inverse()),
    );
    let error = [away.x, away.y, away.z, angle.x, angle.y, angle.z];
    let far = error.iter().map(|e| e * e).sum::<f64>().sqrt();
    if drifts.is_none() && far < POSE_TOLERANCE {
        return (Joints::zeros(n), far);
    }
    let jacobian = frames.flange_jacobian();
    let mut rows = [Joints::zeros(n); TASK_ROWS];
    for i in 0..n {
        let (linear, angular): (DVec3, DVec3) = (jacobian.linear()[i], ROTATION_LEVER * jacobian.angular()[i]);
        for a in 0..3 {
            rows[a][i] = linear[a];
            rows[3 + a][i] = angular[a];
        }
    }
    let free = crate::chain::JointSet::default();
    let Some(drifts) = drifts else { return (solve_task(&rows, free, error, 1e-10, 2), far) };
    let wish = Joints::from_fn(n, |i| {
        let [low, high] = arm.segments()[i].joint.limits.position;
        let margin = LIMIT_MARGIN.min(0.25 * (high - low));
        let off = (low + margin - q[i]).max(0.0) - (q[i] - (high - margin)).max(0.0);
        DRIFT_RATE * (0.5 * (arm.home()[i] - q[i]) + off)
    });
    // The preferred motion without its part that moves the flange.
    let moved: [f64; TASK_ROWS] = std::array::from_fn(|a| rows[a].dot(&wish));
    let undo = solve_task(&rows, free, moved, 1e-10, 2);
    let mut step = solve_task(&rows, free, error, 1e-10, 2);
    let drift = Joints::from_fn(n, |i| wish[i] - undo[i]);
    for i in 0..n {
        step[i] += drifts * drift[i];
    }
    (step, far)
}

/// Coordinates at `share` of the path between two; the jaw is the target's.
pub(super) fn between(from: &Coordinates, to: &Coordinates, share: f64) -> Coordinates {
    Coordinates {
        pivots: [0, 1].map(|k| linear(from.pivots[k], to.pivots[k], share)),
        insertion: linear(from.insertion, to.insertion, share),
        roll: linear(from.roll, to.roll, share),
        jaw: coordinates::clamp_with_excess(to.jaw, [0.0, 1.0]).0,
    }
}
