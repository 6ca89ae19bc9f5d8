//! An arm's state, and its integration over one physics step.
//!
//! Semi-implicit Euler: rigid-body forces at the start of the step; damping, friction, stops and
//! couplings at its end (`resist.rs`).

use super::arm::SerialArm;
use super::joints::{JointSet, Joints};
use super::resist::{Problem, Row};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Maximum number of couplings in a step.
pub const MAX_COUPLINGS: usize = 16;
/// Maximum number of rounds in which the limit of friction follows the normal force.
const MAX_FRICTION_ROUNDS: usize = 36;

/// Positions and rates of an arm's joints. A copy is an exact snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArmState {
    /// Positions (rad or m).
    pub q: Joints,
    /// Rates (rad/s or m/s).
    pub qd: Joints,
}

impl ArmState {
    /// At rest in the posture `q`.
    pub fn at_rest(q: Joints) -> Self {
        Self { q, qd: Joints::zeros(q.len()) }
    }
}

/// The forces that a coupling can exert.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CouplingLaw {
    /// It pulls and pushes.
    Bilateral,
    /// It only pushes along the row: a contact. A positive displacement is a gap.
    Push,
    /// Coulomb friction: at most `coefficient` times the magnitude of the force of coupling `of`,
    /// which must be [`CouplingLaw::Bilateral`] or [`CouplingLaw::Push`].
    Friction {
        /// Index of the coupling with the normal force.
        of: usize,
        /// Coefficient of friction.
        coefficient: f64,
    },
}

/// A stiff spring with a damper between the arm and the world along one direction: the action of a
/// port's rim, a table or a hand. It is implicit, so no stiffness is too high for the step.
///
/// With u = row . qd the force along the row is -(stiffness x displacement + damping u), limited by
/// the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Speed along the direction per unit of joint rate: a row of a Jacobian, from
    /// [`Jacobian::row`](super::frames::Jacobian::row).
    pub row: Joints,
    /// Extension of the spring along the row (m or rad), at the start of the step; after the step,
    /// at its end.
    pub displacement: f64,
    /// Stiffness (N/m or N m/rad).
    pub stiffness: f64,
    /// Damping (N s/m or N m s/rad). Unless it is small compared to stiffness times step, a push
    /// may start a little before the gap closes.
    pub damping: f64,
    /// The possible forces.
    pub law: CouplingLaw,
    /// Output: the mean force along the row over the step (N or N m).
    pub force: f64,
}

impl Coupling {
    /// A spring without damping.
    pub fn new(row: Joints, displacement: f64, stiffness: f64, law: CouplingLaw) -> Self {
        Self { row, displacement, stiffness, damping: 0.0, law, force: 0.0 }
    }
}

/// The torques on an arm in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Torques of the drives (N m or N). The step limits them.
    pub torque: Joints,
    /// Other torques at the joints, from forces on the links (J^T f) (N m or N). They are not
    /// limited.
    pub external: Joints,
}

/// Result of an arm's step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmStepReport {
    /// The torques of the drives after limiting (N m or N).
    pub torque: Joints,
    /// Mean torque of friction and stops over the step (N m or N).
    pub resisting: Joints,
    /// Joints whose commanded torque exceeded the limit.
    pub torque_limited: JointSet,
    /// Joints that a position limit stopped.
    pub at_position_limit: JointSet,
    /// Joints at their maximum speed.
    pub at_velocity_limit: JointSet,
    /// Joints that friction held at the end of the step.
    pub stuck: JointSet,
    /// Whether the velocities solve their equations to rounding in every substep. Contacts of very
    /// different stiffness may prevent this. The velocities are then finite and within limits, and
    /// the caller may repeat the step with more substeps.
    pub converged: bool,
}

impl SerialArm {
    /// Integrates the state over `dt` (s) in `substeps` equal parts. It allocates nothing; the same
    /// input gives the same bits.
    ///
    /// Positions never leave their limits (a state outside may enter but is not pulled in), and
    /// speeds never exceed theirs. Rows of couplings are constant during the step; displacements
    /// are integrated. Coulomb friction is the same at rest and in motion: a joint whose load is
    /// below it does not move at all.
    ///
    /// # Errors
    /// A step that is not positive, no substep, more than [`MAX_COUPLINGS`] couplings, an invalid
    /// coupling, or an input or result that is not finite. State and couplings are then unchanged.
    pub fn step(
        &self,
        state: &mut ArmState,
        drive: &Drive,
        couplings: &mut [Coupling],
        dt: f64,
        substeps: usize,
    ) -> Result<ArmStepReport> {
        self.check_step(state, drive, couplings, dt, substeps)?;
        let n = self.dof();
        let mut report = ArmStepReport {
            torque: self.zeros(),
            resisting: self.zeros(),
            torque_limited: JointSet::default(),
            at_position_limit: JointSet::default(),
            at_velocity_limit: JointSet::default(),
            stuck: JointSet::default(),
            converged: true,
        };
        for (i, s) in self.segments().iter().enumerate() {
            let (asked, limit) = (drive.torque.at(i), s.joint.limits.effort);
            report.torque[i] = asked.clamp(-limit, limit);
            if report.torque[i] != asked {
                report.torque_limited.insert(i);
            }
        }
        let mut impulses = [0.0; MAX_COUPLINGS];
        let mut displacements = [0.0; MAX_COUPLINGS];
        for (d, c) in displacements.iter_mut().zip(couplings.iter()) {
            *d = c.displacement;
        }
        let pushed = Joints::from_fn(n, |i| report.torque[i] + drive.external.at(i));
        let mut new = *state;
        let h = dt / substeps as f64;
        for _ in 0..substeps {
            let old = new;
            self.substep(&mut new, &pushed, couplings, &mut displacements, &mut impulses, h, &mut report)?;
            report.stuck = JointSet::default();
            for i in 0..n {
                if new.qd[i] == 0.0 && old.q[i] == new.q[i] && self.segments()[i].joint.friction > 0.0 {
                    report.stuck.insert(i);
                }
            }
        }
        for r in report.resisting.iter_mut() {
            *r /= dt;
        }
        *state = new;
        for ((c, d), p) in couplings.iter_mut().zip(displacements).zip(impulses) {
            c.displacement = d;
            c.force = p / dt;
        }
        Ok(report)
    }

    #[expect(clippy::too_many_arguments, reason = "the parts of one step, on its stack")]
    fn substep(
        &self,
        state: &mut ArmState,
        pushed: &Joints,
        couplings: &[Coupling],
        displacements: &mut [f64; MAX_COUPLINGS],
        impulses: &mut [f64; MAX_COUPLINGS],
        h: f64,
        report: &mut ArmStepReport,
    ) -> Result<()> {
        let dynamics = self.dynamics(&state.q, &state.qd);
        let mut b = dynamics.mass_matrix.times(&state.qd);
        let mut matrix = dynamics.mass_matrix;
        let (mut friction, mut low, mut high) = (self.zeros(), self.zeros(), self.zeros());
        for (i, s) in self.segments().iter().enumerate() {
            let joint = &s.joint;
            b[i] += h * (pushed[i] - dynamics.bias[i]);
            matrix.add_diagonal(i, h * joint.damping);
            friction[i] = h * joint.friction;
            let ([lowest, highest], fastest) = (joint.limits.position, joint.limits.velocity);
            low[i] = ((lowest - state.q[i]).min(0.0) / h).max(-fastest);
            high[i] = ((highest - state.q[i]).max(0.0) / h).min(fastest);
        }
        let mut rows = [Row::NONE; MAX_COUPLINGS];
        let count = couplings.len();
        for (r, (c, &e)) in rows.iter_mut().zip(couplings.iter().zip(displacements.iter())) {
            let bounds = match c.law {
                CouplingLaw::Bilateral => [f64::NEG_INFINITY, f64::INFINITY],
                CouplingLaw::Push => [0.0, f64::INFINITY],
                CouplingLaw::Friction { .. } => [0.0, 0.0],
            };
            let slope = h * (h * c.stiffness + c.damping);
            *r = Row { row: c.row, slope, offset: h * c.stiffness * e, bounds };
        }
        let rubs = couplings.iter().any(|c| matches!(c.law, CouplingLaw::Friction { .. }));
        let mut v = state.qd;
        for round in 0..MAX_FRICTION_ROUNDS {
            let mut changed = false;
            for (k, c) in couplings.iter().enumerate() {
                if let CouplingLaw::Friction { of, coefficient } = c.law {
                    let (last, now) = (rows[k].bounds[1], coefficient * rows[of].impulse(&v).abs());
                    changed |= (now - last).abs() > 1e-7 * now;
                    // Damped by one half if the two forces oscillate.
                    let limit = if round < MAX_FRICTION_ROUNDS / 3 { now } else { 0.5 * (last + now) };
                    rows[k].bounds = [-limit, limit];
                }
            }
            if round > 0 && !changed {
                break;
            }
            let rows = &rows[..count];
            let problem = Problem { h: &matrix, b: &b, friction: &friction, low: &low, high: &high, rows };
            report.converged &= problem.minimise(&mut v);
            if !rubs {
                break;
            }
            report.converged &= round + 1 < MAX_FRICTION_ROUNDS;
        }
        let rows = &rows[..count];
        let resisting = Problem { h: &matrix, b: &b, friction: &friction, low: &low, high: &high, rows }.gradient(&v);
        for (k, r) in rows.iter().enumerate() {
            impulses[k] += r.impulse(&v);
            displacements[k] += h * r.row.dot(&v);
        }
        for (i, s) in self.segments().iter().enumerate() {
            report.resisting[i] += resisting[i];
            let limits = &s.joint.limits;
            let from = state.q[i];
            let to = from + h * v[i];
            // Rounding must not move it past the stop.
            state.q[i] = to.max(limits.position[0].min(from)).min(limits.position[1].max(from));
            let stopped = (v[i] == low[i] && v[i] > -limits.velocity) || (v[i] == high[i] && v[i] < limits.velocity);
            // At rest against a stop, friction alone may hold it.
            if stopped && (v[i] != 0.0 || resisting[i].abs() > friction[i]) {
                report.at_position_limit.insert(i);
            }
            if v[i].abs() == limits.velocity {
                report.at_velocity_limit.insert(i);
            }
        }
        state.qd = v;
        // The gradient is not finite if the numbers are too large for a minimum.
        let solved = state.q.is_finite() && state.qd.is_finite() && resisting.is_finite();
        if !(solved && displacements.iter().all(|d| d.is_finite())) {
            return Err(Error::NotFinite { what: "the arm's state after the step" });
        }
        Ok(())
    }

    fn check_step(
        &self,
        state: &ArmState,
        drive: &Drive,
        couplings: &[Coupling],
        dt: f64,
        substeps: usize,
    ) -> Result<()> {
        let n = self.dof();
        if [&state.q, &state.qd, &drive.torque, &drive.external].iter().any(|j| j.len() != n) {
            return Err(Error::invalid("step", format!("state and drive must have {n} joints, like the arm")));
        }
        if !(dt > 0.0 && dt.is_finite() && substeps > 0) {
            return Err(Error::invalid("step", "dt must be positive and finite, substeps at least 1"));
        }
        if ![&state.q, &state.qd, &drive.torque, &drive.external].iter().all(|j| j.is_finite()) {
            return Err(Error::NotFinite { what: "a number of the state or the drive" });
        }
        if couplings.len() > MAX_COUPLINGS {
            let reason = format!("there are {}; the maximum is {MAX_COUPLINGS}", couplings.len());
            return Err(Error::invalid("couplings", reason));
        }
        for (k, c) in couplings.iter().enumerate() {
            let positive = |x: f64| x >= 0.0 && x.is_finite();
            if !(c.row.is_finite() && c.displacement.is_finite() && positive(c.stiffness) && positive(c.damping)) {
                let reason = "must be finite, with stiffness and damping not negative";
                return Err(Error::invalid(format!("coupling {k}"), reason));
            }
            if let CouplingLaw::Friction { of, coefficient } = c.law {
                let presses = couplings.get(of).is_some_and(|o| !matches!(o.law, CouplingLaw::Friction { .. }));
                if !(presses && positive(coefficient)) {
                    let reason = "friction needs a coupling with a normal force and a coefficient that is not negative";
                    return Err(Error::invalid(format!("coupling {k}"), reason));
                }
            }
        }
        Ok(())
    }
}
