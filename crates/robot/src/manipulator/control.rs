//! The control laws: from reference and measured joints to torques.

use super::reference::Reference;
use super::settings::{Law, Settings};
use crate::chain::{ArmState, Dynamics, JointSet, Joints, LEVER, SerialArm, TASK, solve, turn};
use crate::instrument::Instrument;
use crate::port::{Port, Shaft};
use serde::{Deserialize, Serialize};

/// Most torque that integral action or observer may add, as a share of the joint's limit: what is
/// more is no error of a model.
const CORRECTION_SHARE: f64 = 0.3;
/// Integral action and observer leave a joint alone that stands still this near to its reference
/// (rad or m; rad/s or m/s): with friction they would wind up and move it to and fro for ever. A
/// touch over 0.05 mm at the tip.
const QUIET: [f64; 2] = [8e-5, 1e-4];
/// They take it up again from here, or when its reference moves.
const AWAKE: [f64; 2] = [1.6e-4, 1e-3];

/// Damping of the task's error in joints (m2): near postures in which the arm loses a direction the
/// joints' own error is better.
const TRUSTED: f64 = 1e-4;

/// What a controller remembers between steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// The last torques (N m or N).
    pub torque: Joints,
    /// Integral of the error (rad s or m s), or what the observer found: torques that the model
    /// does not know (N m or N).
    pub correction: Joints,
    /// Joints that stand still where they should.
    pub asleep: JointSet,
}

impl Memory {
    /// At rest under these torques.
    pub fn at_rest(torque: Joints) -> Self {
        Self { torque, correction: Joints::zeros(torque.len()), asleep: JointSet::default() }
    }

    /// Says anew which joints need no correction.
    fn watch(&mut self, error: &Joints, rate: &Joints, wanted: &Joints) {
        let mut asleep = JointSet::default();
        for i in 0..error.len() {
            let [near, slow] = if self.asleep.contains(i) { AWAKE } else { QUIET };
            if error[i].abs() < near && rate[i].abs() < slow && wanted[i].abs() < slow {
                asleep.insert(i);
            }
        }
        self.asleep = asleep;
    }
}

/// What does not change.
pub(super) struct Plan<'a> {
    pub settings: &'a Settings,
    pub believed: &'a SerialArm,
    /// The joints' own inertias in the start posture (kg m2 or kg).
    pub inertia: &'a Joints,
    pub instrument: &'a Instrument,
    pub port: &'a Port,
}

impl Plan<'_> {
    /// The torques for a step of `dt` (s): within the arm's limits and their rate. `from` and `to`
    /// are the references at its beginning and end.
    pub fn torque(
        &self,
        memory: &mut Memory,
        measured: &ArmState,
        dynamics: &Dynamics,
        from: &Reference,
        to: &Reference,
        dt: f64,
    ) -> Joints {
        let n = measured.q.len();
        let (law, g) = (self.settings.law, &self.settings.gains);
        let stiffness = g.bandwidth * g.bandwidth;
        let behind = Joints::from_fn(n, |i| from.q[i] - measured.q[i]);
        let slower = Joints::from_fn(n, |i| from.qd[i] - measured.qd[i]);
        let error = match law {
            Law::RcmImpedance => self.task_error(&behind, dynamics, from),
            _ => behind,
        };
        memory.watch(&behind, &measured.qd, &from.qd);
        let mut wanted = to.qdd;
        if law != Law::JointImpedance {
            for i in 0..n {
                wanted[i] += self.correction(error[i], slower[i], dynamics.mass_matrix.row(i)[i]);
            }
        }
        if law == Law::Integral {
            for i in 0..n {
                if !memory.asleep.contains(i) {
                    // No more than a share of the joint's torque.
                    let most = CORRECTION_SHARE * self.effort(i)
                        / (stiffness * g.integral * dynamics.mass_matrix.row(i)[i]).max(1e-9);
                    memory.correction[i] = (memory.correction[i] + dt * error[i]).clamp(-most, most);
                }
                wanted[i] += stiffness * g.integral * memory.correction[i];
            }
        }
        let mut torque = dynamics.mass_matrix.times(&wanted);
        for i in 0..n {
            torque[i] += dynamics.bias[i];
            if law == Law::JointImpedance {
                torque[i] += self.inertia[i] * self.correction(error[i], slower[i], self.inertia[i]);
            }
            if law.observes() {
                torque[i] += memory.correction[i];
            }
            let (limit, change) = (self.effort(i), self.settings.torque_rate * dt);
            let last = memory.torque[i];
            torque[i] = torque[i].clamp(last - change, last + change).clamp(-limit, limit);
        }
        memory.torque = torque;
        torque
    }

    /// Learns from a step of `dt` (s) what torque it took beyond what the model says.
    pub fn learn(&self, memory: &mut Memory, dynamics: &Dynamics, before: &ArmState, after: &ArmState, dt: f64) {
        if !self.settings.law.observes() {
            return;
        }
        let n = before.q.len();
        let rate = Joints::from_fn(n, |i| (after.qd[i] - before.qd[i]) / dt);
        let inertial = dynamics.mass_matrix.times(&rate);
        let share = 1.0 - (-self.settings.gains.observer * dt).exp();
        for i in 0..n {
            if memory.asleep.contains(i) {
                continue;
            }
            let missing = memory.torque[i] - inertial[i] - dynamics.bias[i];
            let most = CORRECTION_SHARE * self.effort(i);
            memory.correction[i] = (memory.correction[i] + share * (missing - memory.correction[i])).clamp(-most, most);
        }
    }

    /// The acceleration that brings an error back: w^2 e + 2 z w e' where it is small. A torque
    /// that may change by no more than r a second gives a joint of inertia m no more jerk than j =
    /// r/m, and a loop that asks for more swings up. So the speed of the way back, and its
    /// acceleration, grow with the root alone from where to bring them to zero again at the loop's
    /// pace would take half that jerk.
    fn correction(&self, error: f64, slower: f64, inertia: f64) -> f64 {
        let g = &self.settings.gains;
        let w = g.bandwidth;
        let jerk = self.settings.torque_rate / inertia.max(1e-6);
        if g.damping <= 0.0 {
            return w * w * error;
        }
        let most = jerk / (4.0 * g.damping * w);
        let back = rooted(w / (2.0 * g.damping) * error, g.damping * most / w);
        rooted(2.0 * g.damping * w * (back + slower), most)
    }

    fn effort(&self, i: usize) -> f64 {
        self.believed.segments()[i].joint.limits.effort
    }

    /// The joints' error as the tip, the port and the roll see it, the port's share weighed; the
    /// elbow's as it is.
    fn task_error(&self, behind: &Joints, dynamics: &Dynamics, from: &Reference) -> Joints {
        let n = behind.len();
        let (is, shall) = (dynamics.frames.flange(), self.believed.frames(&from.q).flange());
        let (tip, wanted) = (self.instrument.tip(&is), self.instrument.tip(&shall));
        let (shaft, other) = (Shaft::of(self.instrument, &is), Shaft::of(self.instrument, &shall));
        // Where the shafts are nearest to the centre.
        let at = |s: &Shaft| s.base + (self.port.centre() - s.base).dot(s.direction) * s.direction;
        let (here, there) = (at(&shaft), at(&other));
        let (one, two) = shaft.direction.any_orthonormal_pair();
        let (of_tip, of_port) = (dynamics.frames.jacobian(n, tip.translation), dynamics.frames.jacobian(n, here));
        let mut rows = [Joints::zeros(n); TASK];
        for i in 0..n {
            let (t, p) = (of_tip.linear()[i], of_port.linear()[i]);
            let about = LEVER * of_tip.angular()[i].dot(shaft.direction);
            let column = [t.x, t.y, t.z, p.dot(one), p.dot(two), about];
            for (row, value) in rows.iter_mut().zip(column) {
                row[i] = value;
            }
        }
        let (d, r) = (wanted.translation - tip.translation, turn(wanted.rotation * tip.rotation.inverse()));
        let weight = self.settings.gains.port;
        let away = there - here;
        let task = [d.x, d.y, d.z, away.dot(one), away.dot(two), LEVER * r.dot(shaft.direction)];
        let weighed = [0.0, 0.0, 0.0, (weight - 1.0) * task[3], (weight - 1.0) * task[4], 0.0];
        // The joints' error already holds the task's to first order; what is added is the rest of
        // it and the port's weight.
        let extra: [f64; TASK] = std::array::from_fn(|a| task[a] - rows[a].dot(behind) + weighed[a]);
        let add = solve(&rows, JointSet::default(), extra, TRUSTED, 1);
        Joints::from_fn(n, |i| behind[i] + add[i])
    }
}

/// `x` up to `limit`, from there on growing as a root does, with no kink.
fn rooted(x: f64, limit: f64) -> f64 {
    if x.abs() <= limit { x } else { limit.copysign(x) * (2.0 * x.abs() / limit - 1.0).sqrt() }
}
