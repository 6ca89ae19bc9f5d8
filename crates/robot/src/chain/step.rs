//! An arm's state, and its motion through one physics step.
//!
//! Semi-implicit Euler: rigid-body forces at the step's beginning; damping, friction, stops and
//! couplings at its end (`resist.rs`).

use super::arm::SerialArm;
use super::joints::{JointSet, Joints};
use super::resist::{Problem, Row};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// The most couplings a step may have.
pub const MAX_COUPLINGS: usize = 16;
/// Rounds in which the limit of friction follows the force that presses.
const FRICTION_ROUNDS: usize = 36;

/// Where an arm's joints are and how fast they move. Plain data: a copy is an exact snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArmState {
    /// Positions (rad or m).
    pub q: Joints,
    /// Rates (rad/s or m/s).
    pub qd: Joints,
}

impl ArmState {
    /// At rest.
    pub fn at_rest(q: Joints) -> Self {
        Self { q, qd: Joints::zeros(q.len()) }
    }
}

/// Which forces a coupling can exert.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CouplingLaw {
    /// Pulls and pushes.
    Bilateral,
    /// Only pushes along the row: a touch. A displacement above zero is a gap.
    Push,
    /// Coulomb friction: at most `coefficient` times the magnitude of the force of the coupling
    /// number `of`, which must be a [`CouplingLaw::Bilateral`] or [`CouplingLaw::Push`] one.
    Friction {
        /// The coupling that presses, by its place in the list.
        of: usize,
        /// Coefficient of friction.
        coefficient: f64,
    },
}

/// A stiff spring with a damper between the arm and the world along one direction: what a port's
/// rim, a table or a hand does to it. It is implicit, so that no stiffness is too high for the
/// step.
///
/// With u = row . qd the force along the row is -(stiffness x displacement + damping u), within
/// what the law allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Speed along the direction a unit of joint rate: a row of a Jacobian, from
    /// [`super::Jacobian::row`].
    pub row: Joints,
    /// How far the spring is stretched along the row (m or rad). Given for the step's beginning;
    /// after it, for its end.
    pub displacement: f64,
    /// Stiffness (N/m or N m/rad).
    pub stiffness: f64,
    /// Damping (N s/m or N m s/rad). A push may begin a little before the gap closes where this is
    /// not small beside stiffness times step.
    pub damping: f64,
    /// Which forces are possible.
    pub law: CouplingLaw,
    /// Filled in by the step: the mean force along the row over the step (N or N m).
    pub force: f64,
}

impl Coupling {
    /// A spring of that displacement and stiffness without damping.
    pub fn new(row: Joints, displacement: f64, stiffness: f64, law: CouplingLaw) -> Self {
        Self { row, displacement, stiffness, damping: 0.0, law, force: 0.0 }
    }
}

/// What drives an arm through a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Torques of the joints' drives (N m or N), kept within their limits by the step.
    pub torque: Joints,
    /// Other torques at the joints, from forces on the links (J^T f): not limited.
    pub external: Joints,
}

/// What happened in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The torques of the drives that acted, after limiting (N m or N).
    pub torque: Joints,
    /// Mean torque of friction and stops over the step (N m or N).
    pub resisting: Joints,
    /// Joints whose drive was asked for more than its limit.
    pub torque_limited: JointSet,
    /// Joints that a position limit stopped.
    pub at_position_limit: JointSet,
    /// Joints that ran at their highest speed.
    pub at_velocity_limit: JointSet,
    /// Joints that friction held still at the end of the step.
    pub stuck: JointSet,
    /// Whether the velocities solved their equations to rounding in every sub-step. Where they did
    /// not, which takes touches of very different stiffness, they are finite and within limits, and
    /// the step may be repeated with more sub-steps.
    pub converged: bool,
}

impl SerialArm {
    /// Moves the state on by `dt` (s) in `substeps` equal parts. Allocates nothing; the same
    /// numbers give the same bits.
    ///
    /// Positions never leave their limits (a state that is outside is let in, not pulled in),
    /// speeds never exceed theirs. Rows of couplings hold for the whole step, displacements advance
    /// in it. Friction is Coulomb's, the same at rest and in motion: a joint whose load is below it
    /// stands still to the bit.
    ///
    /// # Errors
    /// A length of step that is not positive, no substep, more than [`MAX_COUPLINGS`] or an
    /// impossible coupling, or a number that is not finite, be it given or a result. State and
    /// couplings are then as before.
    pub fn step(
        &self,
        state: &mut ArmState,
        drive: &Drive,
        couplings: &mut [Coupling],
        dt: f64,
        substeps: usize,
    ) -> Result<StepReport> {
        self.check_step(state, drive, couplings, dt, substeps)?;
        let n = self.dof();
        let mut report = StepReport {
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

    #[expect(clippy::too_many_arguments, reason = "the parts of one step, kept on its stack")]
    fn substep(
        &self,
        state: &mut ArmState,
        pushed: &Joints,
        couplings: &[Coupling],
        displacements: &mut [f64; MAX_COUPLINGS],
        impulses: &mut [f64; MAX_COUPLINGS],
        h: f64,
        report: &mut StepReport,
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
        for round in 0..FRICTION_ROUNDS {
            let mut changed = false;
            for (k, c) in couplings.iter().enumerate() {
                if let CouplingLaw::Friction { of, coefficient } = c.law {
                    let (last, now) = (rows[k].bounds[1], coefficient * rows[of].impulse(&v).abs());
                    changed |= (now - last).abs() > 1e-7 * now;
                    // Half way where the two chase each other.
                    let limit = if round < FRICTION_ROUNDS / 3 { now } else { 0.5 * (last + now) };
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
            report.converged &= round + 1 < FRICTION_ROUNDS;
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
            // Rounding must not carry it over the stop.
            state.q[i] = to.max(limits.position[0].min(from)).min(limits.position[1].max(from));
            let stopped = (v[i] == low[i] && v[i] > -limits.velocity) || (v[i] == high[i] && v[i] < limits.velocity);
            // At rest against a stop friction may be all that holds it.
            if stopped && (v[i] != 0.0 || resisting[i].abs() > friction[i]) {
                report.at_position_limit.insert(i);
            }
            if v[i].abs() == limits.velocity {
                report.at_velocity_limit.insert(i);
            }
        }
        state.qd = v;
        // A minimum that is none, of numbers too large, shows in the gradient.
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
            return Err(Error::invalid("step", format!("state and drive must have {n} joints, as the arm has")));
        }
        if !(dt > 0.0 && dt.is_finite() && substeps > 0) {
            return Err(Error::invalid("step", "dt must be positive and finite, substeps at least 1"));
        }
        if ![&state.q, &state.qd, &drive.torque, &drive.external].iter().all(|j| j.is_finite()) {
            return Err(Error::NotFinite { what: "a number of the state or the drive" });
        }
        if couplings.len() > MAX_COUPLINGS {
            let reason = format!("{} given, at most {MAX_COUPLINGS} are possible", couplings.len());
            return Err(Error::invalid("couplings", reason));
        }
        for (k, c) in couplings.iter().enumerate() {
            let positive = |x: f64| x >= 0.0 && x.is_finite();
            if !(c.row.is_finite() && c.displacement.is_finite() && positive(c.stiffness) && positive(c.damping)) {
                let reason = "must be finite, stiffness and damping not negative";
                return Err(Error::invalid(format!("coupling {k}"), reason));
            }
            if let CouplingLaw::Friction { of, coefficient } = c.law {
                let presses = couplings.get(of).is_some_and(|o| !matches!(o.law, CouplingLaw::Friction { .. }));
                if !(presses && positive(coefficient)) {
                    let reason = "friction needs a coupling that presses and a coefficient that is not negative";
                    return Err(Error::invalid(format!("coupling {k}"), reason));
                }
            }
        }
        Ok(())
    }
}
