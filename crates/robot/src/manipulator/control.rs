//! The control laws: torques from reference and measured joints.

use super::reference::Reference;
use super::settings::{ControllerSettings, Law};
use crate::chain::{
    ArmState, Dynamics, JointSet, Joints, ROTATION_LEVER, SerialArm, TASK_ROWS, rotation_vector, solve_task,
};
use crate::instrument::Instrument;
use crate::port::{Port, Shaft};
use serde::{Deserialize, Serialize};

/// Maximum torque of integral action or observer, as a share of the joint's limit. A larger one is
/// not a model error.
const MAX_CORRECTION_SHARE: f64 = 0.3;
/// Integral action and observer pause for a joint that stands still this near to its reference (rad
/// or m; rad/s or m/s). With friction they would wind up and cause a limit cycle. At the tip this
/// is a little over 0.05 mm.
const PAUSE_BELOW: [f64; 2] = [8e-5, 1e-4];
/// They resume above this error and rate, or when the reference moves.
const RESUME_ABOVE: [f64; 2] = [1.6e-4, 1e-3];

/// Damping of the task's error in joints (m2): near singular postures the joint error is better.
const TASK_DAMPING: f64 = 1e-4;

/// The controller's state between steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// The last torques (N m or N).
    pub torque: Joints,
    /// Integral of the error (rad s or m s), or the observed torques that are not in the model (N m
    /// or N).
    pub correction: Joints,
    /// Joints that stand still at their reference.
    pub paused: JointSet,
}

impl Memory {
    /// At rest under `torque`.
    pub fn at_rest(torque: Joints) -> Self {
        Self { torque, correction: Joints::zeros(torque.len()), paused: JointSet::default() }
    }

    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self { torque, correction, paused } = self;
        let paused = (0..torque.len()).map(|i| f64::from(u8::from(paused.contains(i))));
        torque.iter().chain(correction.iter()).copied().chain(paused)
    }

    /// Updates the joints that need no correction.
    fn update_paused(&mut self, error: &Joints, rate: &Joints, wanted: &Joints) {
        let mut paused = JointSet::default();
        for i in 0..error.len() {
            let [near, slow] = if self.paused.contains(i) { RESUME_ABOVE } else { PAUSE_BELOW };
            if error[i].abs() < near && rate[i].abs() < slow && wanted[i].abs() < slow {
                paused.insert(i);
            }
        }
        self.paused = paused;
    }
}

/// The constants of a controller.
pub(super) struct Controller<'a> {
    pub settings: &'a ControllerSettings,
    pub believed: &'a SerialArm,
    /// The joints' diagonal inertias in the start posture (kg m2 or kg).
    pub inertia: &'a Joints,
    pub instrument: &'a Instrument,
    pub port: &'a Port,
}

impl Controller<'_> {
    /// The torques for a step of `dt` (s), within the limits of torque and its rate. `from` and
    /// `to` are the references at the start and the end of the step.
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
        memory.update_paused(&behind, &measured.qd, &from.qd);
        let mut wanted = to.qdd;
        if law != Law::JointImpedance {
            for i in 0..n {
                wanted[i] += self.correction(error[i], slower[i], dynamics.mass_matrix.row(i)[i]);
            }
        }
        if law == Law::Integral {
            for i in 0..n {
                if !memory.paused.contains(i) {
                    // At most a share of the joint's torque.
                    let most = MAX_CORRECTION_SHARE * self.effort(i)
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

    /// Updates the disturbance observer with the torque of a step of `dt` (s) that is not in the
    /// model.
    pub fn observe(&self, memory: &mut Memory, dynamics: &Dynamics, before: &ArmState, after: &ArmState, dt: f64) {
        if !self.settings.law.observes() {
            return;
        }
        let n = before.q.len();
        let rate = Joints::from_fn(n, |i| (after.qd[i] - before.qd[i]) / dt);
        let inertial = dynamics.mass_matrix.times(&rate);
        let share = 1.0 - libm::exp(-self.settings.gains.observer * dt);
        for i in 0..n {
            if memory.paused.contains(i) {
                continue;
            }
            let missing = memory.torque[i] - inertial[i] - dynamics.bias[i];
            let most = MAX_CORRECTION_SHARE * self.effort(i);
            memory.correction[i] = (memory.correction[i] + share * (missing - memory.correction[i])).clamp(-most, most);
        }
    }

    /// The acceleration that corrects an error: w^2 e + 2 z w e' for small errors. A torque rate of
    /// at most r limits the jerk of a joint of inertia m to j = r/m, and a loop that needs more
    /// becomes unstable. So the speed of the correction and its acceleration grow only with the
    /// square root, from the point where stopping them at the loop's bandwidth would take half of
    /// this jerk.
    fn correction(&self, error: f64, slower: f64, inertia: f64) -> f64 {
        let g = &self.settings.gains;
        let w = g.bandwidth;
        let jerk = self.settings.torque_rate / inertia.max(1e-6);
        if g.damping <= 0.0 {
            return w * w * error;
        }
        let most = jerk / (4.0 * g.damping * w);
        let back = soft_limit(w / (2.0 * g.damping) * error, g.damping * most / w);
        soft_limit(2.0 * g.damping * w * (back + slower), most)
    }

    fn effort(&self, i: usize) -> f64 {
        self.believed.segments()[i].joint.limits.effort
    }

    /// The joint error with its task part replaced by the errors of tip, port (weighted) and roll.
    /// The null-space part is unchanged.
    fn task_error(&self, behind: &Joints, dynamics: &Dynamics, from: &Reference) -> Joints {
        let n = behind.len();
        let (is, shall) = (dynamics.frames.flange(), self.believed.frames(&from.q).flange());
        let (tip, wanted) = (self.instrument.tip(&is), self.instrument.tip(&shall));
        let (shaft, other) = (Shaft::of(self.instrument, &is), Shaft::of(self.instrument, &shall));
        // The points of the shafts nearest to the centre.
        let at = |s: &Shaft| s.base + (self.port.centre() - s.base).dot(s.direction) * s.direction;
        let (here, there) = (at(&shaft), at(&other));
        let (one, two) = shaft.direction.any_orthonormal_pair();
        let (of_tip, of_port) = (dynamics.frames.jacobian(n, tip.translation), dynamics.frames.jacobian(n, here));
        let mut rows = [Joints::zeros(n); TASK_ROWS];
        for i in 0..n {
            let (t, p) = (of_tip.linear()[i], of_port.linear()[i]);
            let about = ROTATION_LEVER * of_tip.angular()[i].dot(shaft.direction);
            let column = [t.x, t.y, t.z, p.dot(one), p.dot(two), about];
            for (row, value) in rows.iter_mut().zip(column) {
                row[i] = value;
            }
        }
        let (d, r) = (wanted.translation - tip.translation, rotation_vector(wanted.rotation * tip.rotation.inverse()));
        let weight = self.settings.gains.port;
        let away = there - here;
        let task = [d.x, d.y, d.z, away.dot(one), away.dot(two), ROTATION_LEVER * r.dot(shaft.direction)];
        let weighed = [0.0, 0.0, 0.0, (weight - 1.0) * task[3], (weight - 1.0) * task[4], 0.0];
        // The joint error contains the task error to first order. Adds the rest of it and the
        // weight of the port.
        let extra: [f64; TASK_ROWS] = std::array::from_fn(|a| task[a] - rows[a].dot(behind) + weighed[a]);
        let add = solve_task(&rows, JointSet::default(), extra, TASK_DAMPING, 1);
        Joints::from_fn(n, |i| behind[i] + add[i])
    }
}

/// `x` up to `limit`, then growing like a square root, without a kink.
fn soft_limit(x: f64, limit: f64) -> f64 {
    if x.abs() <= limit { x } else { limit.copysign(x) * (2.0 * x.abs() / limit - 1.0).sqrt() }
}
