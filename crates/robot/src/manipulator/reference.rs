//! From commands thirty times a second to a smooth motion of the joints.
//!
//! Commands pass through two filters. A *limiter*, once a command: the next control point goes towards the command no faster and with no more acceleration than is
//! allowed, and is the command itself where that is slow enough. Then a uniform quadratic B-spline through the control points: the reference's speed is continuous, its acceleration bounded,
//! and a command that moves steadily is followed steadily. The spline is 1.5 command periods (50 ms) behind a signal whose samples are the
//! commands, one (33 ms) behind the mean of the held commands.
//!
//! The spline runs in the instrument's coordinates, so that the shaft's axis goes through the port's centre at every instant and not only at the
//! commands. The joints follow by one or two Newton steps a physics step; the elbow drifts to the arm's home posture and off its limits. Where the arm cannot follow (a joint
//! at a limit or too fast) the spline's time runs slower, or stands still.

use crate::chain::{Joints, LEVER, SerialArm, TASK, solve, turn};
use crate::instrument::{Coordinates, Instrument, Limits, coordinates};
use crate::port::Port;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// Highest speed and acceleration of the control points: the two pivots [rad/s, rad/s2], insertion [m/s, m/s2], roll [rad/s, rad/s2]. Commands that stay below both
/// pass unchanged.
const COORDINATE_LIMITS: [[f64; 2]; 4] = [[0.6, 3.0], [0.6, 3.0], [0.15, 1.0], [2.0, 10.0]];
/// Share of a joint's highest speed that the reference may use.
const SPEED_SHARE: f64 = 0.5;
/// With what acceleration joints come to rest at their limits [rad/s2 or m/s2].
const BRAKING: f64 = 8.0;
/// How long the spline takes to come back to its pace [s], and the pace below which it stands still.
const RECOVERY: f64 = 0.3;
const STANDSTILL: f64 = 0.04;
/// Below this pace the joints' highest speeds fall with it: where the arm is nearly stretched it comes to rest instead of running into its end.
const EASE: f64 = 0.7;
/// No joint of the reference gains speed faster [rad/s2 or m/s2]; far above what motions away from singular postures take.
const QUICKEST: f64 = 25.0;
/// Acceleration of joint commands where the arm has no limit of its own [rad/s2 or m/s2].
const JOINT_ACCELERATION: f64 = 10.0;
/// Share of a period by which a sum of steps may be off.
const ROUNDING: f64 = 1e-9;
/// The flange is where it should be [m, with angles at a lever].
const CLOSE: f64 = 1e-9;
/// Beyond that the arm does not reach the pose [m].
const FAR: f64 = 2e-6;
/// How fast the elbow goes where it likes to be [1/s].
const ELBOW: f64 = 4.0;
/// It moves only while the instrument does, with all of that from this speed on (a coordinate a second, insertions five times as much): a joint that creeps while
/// the instrument rests would stick and slip.
const MOVING: f64 = 0.02;
/// Joints are pushed off their limits from this far away [rad or m].
const MARGIN: f64 = 0.1;
/// The reference's joints keep this far from their limits [rad or m], which leaves room for the error of the arm behind it.
const KEEP: f64 = 5e-3;

/// What is commanded: coordinates in the port, or joints.
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
    /// Time since the last control point was made [s].
    phase: f64,
    /// The spline now.
    pub value: Joints,
    /// The posture now, and its rate over the last step [rad/s or m/s].
    pub q: Joints,
    pub qd: Joints,
    /// Acceleration over the last step [rad/s2 or m/s2].
    pub qdd: Joints,
    /// Share of the last step that the spline's time took: 1 where the arm could follow.
    pub pace: f64,
}

/// What does not change.
pub(super) struct Ways<'a> {
    pub arm: &'a SerialArm,
    pub instrument: &'a Instrument,
    pub port: &'a Port,
    pub limits: &'a Limits,
    pub period: f64,
}

/// Four coordinates as a vector.
pub(super) fn pack(c: &Coordinates) -> Joints {
    let a = c.to_action();
    Joints::from_fn(4, |i| a[i])
}

/// The other way; the jaw is the caller's.
pub(super) fn unpack(v: &Joints, jaw: f64) -> Coordinates {
    Coordinates { pivots: [v.at(0), v.at(1)], insertion: v.at(2), roll: v.at(3), jaw }
}

impl Reference {
    /// At rest.
    pub fn at_rest(q: Joints, at: &Coordinates, period: f64) -> Self {
        let (value, still) = (pack(at), Joints::zeros(q.len()));
        let points = [value; 3];
        let goal = Goal::Coordinates;
        Self { goal, target: value, previous: value, points, phase: period, value, q, qd: still, qdd: still, pace: 1.0 }
    }

    /// Whether the joints are commanded.
    pub fn in_joints(&self) -> bool {
        self.goal == Goal::Joints
    }

    /// Commands coordinates. `now` are those of the reference, where it followed joints before.
    pub fn command_coordinates(&mut self, target: &Coordinates, now: &Coordinates) {
        if self.goal == Goal::Joints {
            let value = pack(now);
            (self.goal, self.points, self.value, self.previous) = (Goal::Coordinates, [value; 3], value, value);
        }
        self.target = pack(target);
    }

    /// Commands joints. The reference goes on with its speed.
    pub fn command_joints(&mut self, target: &Joints, period: f64) {
        if self.goal == Goal::Coordinates {
            let (q, qd) = (self.q, self.qd);
            let beside = |s: f64| Joints::from_fn(q.len(), |i| q[i] + s * period * qd[i]);
            (self.goal, self.value, self.previous) = (Goal::Joints, q, q);
            // The next control point is made at once.
            (self.points, self.phase) = ([beside(-1.0), beside(-0.5), beside(0.5)], period);
        }
        self.target = *target;
    }

    /// Goes on by `dt` [s].
    pub fn advance(&mut self, ways: &Ways<'_>, dt: f64) {
        let (before, rate) = (*self, self.qd);
        let mut pace = (before.pace + dt / RECOVERY).min(1.0);
        let ease = (before.pace / EASE).min(1.0);
        // At the pace that it may have, then as much slower as the joints need, then not at all.
        for attempt in 0..3 {
            let stands = attempt == 2 || pace < STANDSTILL;
            *self = before;
            self.pace = if stands { 0.0 } else { pace };
            if stands {
                // The next step asks for the command anew, from rest.
                (self.points, self.phase) = ([self.value; 3], ways.period);
            } else {
                self.run(ways, pace * dt);
            }
            let (wanted, far) = self.posture(ways, &before, dt);
            let mut slower: f64 = 1.0;
            for (i, s) in ways.arm.segments().iter().enumerate() {
                let (from, way) = (before.q[i], wanted[i] - before.q[i]);
                let [low, high] = s.joint.limits.position;
                let keep = KEEP.min(0.25 * (high - low));
                let room = if way > 0.0 { high - keep - from } else { from - low - keep };
                let had = (rate[i] * way.signum()).max(0.0);
                let fastest = (2.0 * BRAKING * room.max(0.0))
                    .sqrt()
                    .min(ease * SPEED_SHARE * s.joint.limits.velocity)
                    .min(had + QUICKEST * dt);
                if way.abs() > fastest * dt {
                    slower = slower.min(fastest * dt / way.abs());
                }
            }
            // What is still too fast at the second attempt is the path's curvature.
            if stands || (far < FAR && (slower == 1.0 || attempt == 1)) {
                for (i, s) in ways.arm.segments().iter().enumerate() {
                    let [low, high] = s.joint.limits.position;
                    self.q[i] = (before.q[i] + slower * (wanted[i] - before.q[i])).clamp(low, high);
                }
                if stands {
                    self.pace = 2.0 * STANDSTILL;
                }
                break;
            }
            pace = if far < FAR { slower * pace } else { 0.0 };
        }
        for i in 0..self.q.len() {
            self.qd[i] = (self.q[i] - before.q[i]) / dt;
            self.qdd[i] = (self.qd[i] - rate[i]) / dt;
        }
    }

    /// Moves the spline on.
    fn run(&mut self, ways: &Ways<'_>, time: f64) {
        let period = ways.period;
        // A control point is made when the first step after its instant begins, so that a command that was given in between is in it.
        while self.phase >= period * (1.0 - ROUNDING) {
            self.renew(ways);
        }
        self.phase += time;
        while self.phase > period * (1.0 + ROUNDING) {
            self.renew(ways);
        }
        let u = (self.phase / period).clamp(0.0, 1.0);
        let w = [0.5 * (1.0 - u) * (1.0 - u), 0.5 + u - u * u, 0.5 * u * u];
        let [a, b, c] = &self.points;
        self.value = Joints::from_fn(a.len(), |i| w[0] * a[i] + w[1] * b[i] + w[2] * c[i]);
    }

    fn renew(&mut self, ways: &Ways<'_>) {
        self.phase -= ways.period;
        let next = self.next(ways);
        self.points = [self.points[1], self.points[2], next];
        self.previous = self.target;
    }

    /// The next control point.
    fn next(&self, ways: &Ways<'_>) -> Joints {
        let (period, [_, before, last]) = (ways.period, &self.points);
        let next = Joints::from_fn(last.len(), |i| {
            let [speed, acceleration] = match self.goal {
                Goal::Coordinates => COORDINATE_LIMITS[i.min(3)],
                Goal::Joints => {
                    let limits = &ways.arm.segments()[i].joint.limits;
                    [SPEED_SHARE * limits.velocity, limits.acceleration.min(JOINT_ACCELERATION)]
                }
            };
            let (left, step) = (self.target.at(i) - last[i], last[i] - before[i]);
            let moves = self.target.at(i) - self.previous.at(i);
            // What moves away need not be stopped at.
            let away = if moves * left > 0.0 { moves.abs().min(left.abs()) } else { 0.0 };
            // The speed from which it can still be stopped at the target, by steps of a period.
            let half = 0.5 * acceleration * period;
            let most = ((half * half + 2.0 * acceleration * left.abs()).sqrt() - half) * period + away;
            let most = most.min(speed * period);
            let change = acceleration * period * period;
            last[i] + left.clamp(-most, most).clamp(step - change, step + change)
        });
        match self.goal {
            Goal::Coordinates => pack(&ways.limits.clamp(&unpack(&next, 0.0)).0),
            Goal::Joints => Joints::from_fn(next.len(), |i| {
                let [low, high] = ways.arm.segments()[i].joint.limits.position;
                next[i].clamp(low, high)
            }),
        }
    }

    /// The posture for where the spline is, and how far its flange is from there.
    fn posture(&self, ways: &Ways<'_>, before: &Self, dt: f64) -> (Joints, f64) {
        if self.goal == Goal::Joints {
            return (self.value, 0.0);
        }
        let n = self.q.len();
        let target = ways.port.flange(ways.instrument, &unpack(&self.value, 0.0));
        let mut q = before.q;
        let mut far = f64::INFINITY;
        let speed = |i: usize| (self.value.at(i) - before.value.at(i)).abs() / dt;
        let fastest = speed(0).max(speed(1)).max(5.0 * speed(2)).max(speed(3));
        let drifts = dt * (fastest / MOVING).min(1.0);
        for round in 0..3 {
            let (step, distance) = newton(ways.arm, &q, &target, (round == 0 && drifts > 0.0).then_some(drifts));
            far = distance;
            if round > 0 && distance < CLOSE {
                break;
            }
            for i in 0..n {
                q[i] += step[i];
            }
        }
        (q, far)
    }
}

/// The joints' step towards a pose of the flange, with the elbow's drift over `drifts` [s] if there is one, and how far the flange is from the pose [m].
fn newton(arm: &SerialArm, q: &Joints, target: &Pose, drifts: Option<f64>) -> (Joints, f64) {
    let n = q.len();
    let frames = arm.frames(q);
    let flange = frames.flange();
    let (away, angle) =
        (target.translation - flange.translation, LEVER * turn(target.rotation * flange.rotation.inverse()));
    let error = [away.x, away.y, away.z, angle.x, angle.y, angle.z];
    let far = error.iter().map(|e| e * e).sum::<f64>().sqrt();
    if drifts.is_none() && far < CLOSE {
        return (Joints::zeros(n), far);
    }
    let jacobian = frames.flange_jacobian();
    let mut rows = [Joints::zeros(n); TASK];
    for i in 0..n {
        let (linear, angular): (DVec3, DVec3) = (jacobian.linear()[i], LEVER * jacobian.angular()[i]);
        for a in 0..3 {
            rows[a][i] = linear[a];
            rows[3 + a][i] = angular[a];
        }
    }
    let free = crate::chain::JointSet::default();
    let Some(drifts) = drifts else { return (solve(&rows, free, error, 1e-10, 2), far) };
    let wish = Joints::from_fn(n, |i| {
        let [low, high] = arm.segments()[i].joint.limits.position;
        let margin = MARGIN.min(0.25 * (high - low));
        let off = (low + margin - q[i]).max(0.0) - (q[i] - (high - margin)).max(0.0);
        ELBOW * (0.5 * (arm.home()[i] - q[i]) + off)
    });
    // The wish less what of it moves the flange.
    let moved: [f64; TASK] = std::array::from_fn(|a| rows[a].dot(&wish));
    let undo = solve(&rows, free, moved, 1e-10, 2);
    let mut step = solve(&rows, free, error, 1e-10, 2);
    let drift = Joints::from_fn(n, |i| wish[i] - undo[i]);
    for i in 0..n {
        step[i] += drifts * drift[i];
    }
    (step, far)
}

/// A share of the way between coordinates; the jaw is the target's.
pub(super) fn between(from: &Coordinates, to: &Coordinates, share: f64) -> Coordinates {
    let mix = |a: f64, b: f64| a + share * (b - a);
    Coordinates {
        pivots: [mix(from.pivots[0], to.pivots[0]), mix(from.pivots[1], to.pivots[1])],
        insertion: mix(from.insertion, to.insertion),
        roll: mix(from.roll, to.roll),
        jaw: coordinates::cut(to.jaw, [0.0, 1.0]).0,
    }
}
