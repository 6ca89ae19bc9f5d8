//! An arm that works with an instrument through a port, under control: commands in, motion out.
//!
//! ```text
//!  commands, 30 Hz ──> reference (limiter, spline, joints) ──> controller ──> torques ──> arm, payload, rim, load on the tip
//!                         setpoint_*                            believes 2% and 5% less          measured_*
//! ```
//!
//! Nothing is moved but by joint torques within the arm's limits. Words are those of CRTK (Su et al. 2020): `servo` commands, `setpoint` is what the controller is
//! given, `measured` what is; `_cp` a pose, `_cv` a twist, `_cf` a force in the cell's axes, `_js` the joints, `_jp` their positions.
//!
//! A step allocates nothing, and its [`ManipulatorState`] is plain data: a copy restored goes on to the bit.

mod control;
mod measure;
mod reference;
mod restart;
mod settings;
mod touch;

pub use measure::JointReadings;
pub use settings::{Gains, Law, ModelError, Settings};

use crate::chain::{self, ArmState, CouplingLaw, Drive, InverseOptions, JointSet, Joints, SerialArm};
use crate::instrument::{Coordinates, Excess, Instrument, Limits, share};
use crate::port::{Port, RimState, Shaft};
use crate::{Error, Result};
use control::{Memory, Plan};
use glam::DVec3;
use reference::{Reference, Ways};
use serde::{Deserialize, Serialize};
use trocar_core::{Pose, Wrench};

/// The longest physics step [s].
const LONGEST: f64 = 0.02;
/// The flange is at a commanded pose when it is this near [m, rad].
const REACHED: [f64; 2] = [1e-6, 1e-5];
/// How often the way to a command that the arm cannot reach is halved.
const HALVINGS: usize = 6;
/// Postures from which the start is searched.
const STARTS: usize = 24;

/// A controlled arm with its instrument in its port.
#[derive(Clone, Debug, PartialEq)]
pub struct Manipulator {
    /// What is: the instrument is its payload.
    arm: SerialArm,
    /// What the controller believes to be.
    believed: SerialArm,
    instrument: Instrument,
    port: Port,
    settings: Settings,
    limits: Limits,
    /// The joints' own inertias in the start posture.
    inertia: Joints,
    state: ManipulatorState,
}

/// All that changes as a [`Manipulator`] moves. Plain data: a copy is an exact snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManipulatorState {
    arm: ArmState,
    reference: Reference,
    memory: Memory,
    rim: RimState,
    /// Opening, its rate [1/s] and where it goes.
    jaw: [f64; 3],
    /// What a sensor at the mount read over the last step, in the cell's axes.
    mount: [DVec3; 2],
}

/// What a command came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commanded {
    /// Where the instrument is sent: within its limits and the arm's reach.
    pub coordinates: Coordinates,
    /// By how much the command lay outside which limit.
    pub excess: Excess,
    /// How much of the way to what the limits leave the arm can go, 0 to 1: 1 where it reaches it.
    pub reach: f64,
    /// What is left of a commanded orientation: axis times angle [rad], in the cell. Zero for coordinates.
    pub rejected_rotation: DVec3,
    /// What is left of a commanded position [m], in the cell, where a limit or the arm's reach binds. Zero for coordinates.
    pub rejected_translation: DVec3,
}

/// What happened in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The arm's own report: torques, joints at limits.
    pub arm: chain::StepReport,
    /// Force with which the shaft presses the rim [N], the sum of its places, mean over the step.
    pub rim_force: f64,
    /// Distance from the port's centre to the shaft's axis, in the port's plane [m], at the step's end.
    pub rcm_deviation: f64,
    /// Share of the step that the reference went on: under 1 where the arm could not follow.
    pub pace: f64,
}

impl StepReport {
    /// Joints that a position limit stopped.
    pub fn stopped(&self) -> JointSet {
        self.arm.at_position_limit
    }
}

impl Manipulator {
    /// `arm` in its place in the cell, with `instrument` at its flange in place of any payload, through `port`, at rest at `start`. The elbow is where the arm's
    /// home posture draws it.
    ///
    /// # Errors
    /// A part that cannot be used; a start outside the limits or one that the arm does not reach.
    pub fn new(
        arm: SerialArm,
        instrument: Instrument,
        port: Port,
        settings: Settings,
        start: Coordinates,
    ) -> Result<Self> {
        settings.check()?;
        instrument.check()?;
        port.check()?;
        let start = Coordinates::from_action(start.to_action())?;
        let mut arm = arm.with_payload(instrument.mass_in_flange())?;
        let n = arm.dof();
        let damping: Vec<f64> = arm.segments().iter().map(|s| s.joint.damping).collect();
        if let Some(friction) = settings.error.friction {
            arm = arm.with_friction(&vec![friction; n], &damping)?;
        }
        let believed = arm.clone().with_mass_scaled(1.0 - settings.error.links, 1.0 - settings.error.instrument)?;
        let limits = match settings.limits {
            Some(limits) => limits,
            None => port.limits(&instrument, 0.0, 0.02)?,
        };
        let (kept, excess) = limits.clamp(&start);
        if let Some((name, by)) = excess.binding().next() {
            return Err(Error::invalid("start", format!("its {name} is outside the limits by {by:.4} (SI units)")));
        }
        let target = port.flange(&instrument, &kept);
        let options = InverseOptions { restarts: STARTS, tolerance: [1e-9, 1e-9], ..InverseOptions::default() };
        let found = arm.inverse(&target, &arm.home(), &options)?;
        if !found.reached {
            let reason = format!(
                "the flange of arm '{}' would be {:.1} mm from its place; bring the base nearer",
                arm.name(),
                1e3 * found.translation.length()
            );
            return Err(Error::invalid("start", reason));
        }
        let dynamics = believed.dynamics(&found.q, &arm.zeros());
        let inertia = Joints::from_fn(n, |i| dynamics.mass_matrix.row(i)[i]);
        let state = ManipulatorState {
            arm: ArmState::at_rest(found.q),
            reference: Reference::at_rest(found.q, &kept, 1.0 / settings.command_rate),
            memory: Memory::at_rest(dynamics.bias),
            rim: RimState::default(),
            jaw: [kept.jaw, 0.0, kept.jaw],
            mount: [DVec3::ZERO; 2],
        };
        let mut made = Self { arm, believed, instrument, port, settings, limits, inertia, state };
        // What the sensor reads at rest, before the first step.
        let at = made.state.arm;
        made.state.mount = made.mount_reading(&at, &at, &made.arm.frames(&at.q), [DVec3::ZERO; 2], 1.0);
        Ok(made)
    }

    /// Commands the instrument's coordinates, absolute. What limits cut off is told.
    ///
    /// # Errors
    /// A number that is not finite: nothing is changed.
    pub fn servo_cp(&mut self, target: &Coordinates) -> Result<Commanded> {
        let target = Coordinates::from_action(target.to_action())?;
        let (kept, excess) = self.limits.clamp(&target);
        let (coordinates, reach) = self.reachable(&kept)?;
        self.send(&coordinates);
        Ok(Commanded { coordinates, excess, reach, rejected_rotation: DVec3::ZERO, rejected_translation: DVec3::ZERO })
    }

    /// Commands a pose of the tip in the cell, and the jaw's opening. Position first; what four degrees of freedom cannot do of the orientation is told.
    ///
    /// # Errors
    /// A number that is not finite, a rotation that is not of unit length: nothing is changed.
    pub fn servo_tip(&mut self, target: &Pose, jaw: f64) -> Result<Commanded> {
        if !jaw.is_finite() {
            return Err(Error::NotFinite { what: "the jaw's opening" });
        }
        let near = Coordinates { jaw, ..self.setpoint_coordinates() };
        let solution = self.port.solve(&self.instrument, &self.limits, target, &near)?;
        let (coordinates, reach) = self.reachable(&solution.coordinates)?;
        let tip = self.port.tip(&coordinates);
        self.send(&coordinates);
        Ok(Commanded {
            coordinates,
            excess: solution.excess,
            reach,
            rejected_rotation: if reach == 1.0 {
                solution.rejected_rotation
            } else {
                chain::turn(target.rotation * tip.rotation.inverse())
            },
            rejected_translation: target.translation - tip.translation,
        })
    }

    /// Commands the joints [rad or m]. Nothing keeps the shaft in the port's centre then, except its rim.
    ///
    /// # Errors
    /// Not a number a joint, one that is not finite or beyond its limits: nothing is changed.
    pub fn servo_jp(&mut self, target: &[f64]) -> Result<()> {
        let target = self.arm.posture(target)?;
        self.state.reference.command_joints(&target, self.period());
        Ok(())
    }

    /// Commands the jaw's opening alone, 0 to 1; what is outside is cut.
    ///
    /// # Errors
    /// A number that is not finite: nothing is changed.
    pub fn servo_jaw(&mut self, opening: f64) -> Result<()> {
        if !opening.is_finite() {
            return Err(Error::NotFinite { what: "the jaw's opening" });
        }
        self.state.jaw[2] = share(opening);
        Ok(())
    }

    /// One physics step of `dt` [s], 1/480 s for instance. `load` is what is done to the instrument's tip: a force [N] at the jaw's pivot and a torque [N m]
    /// about it, along the cell's axes.
    ///
    /// # Errors
    /// A step that is not between 0 and 20 ms, a load that is not finite, or one so great that a result is not: nothing is changed.
    pub fn step(&mut self, load: Wrench, dt: f64) -> Result<StepReport> {
        if !(dt > 0.0 && dt <= LONGEST) {
            return Err(Error::invalid("step", format!("{dt} s is not between 0 and {LONGEST} s")));
        }
        if !load.is_finite() {
            return Err(Error::NotFinite { what: "the load on the tip" });
        }
        let mut next = self.state;
        let (before, from) = (self.state.arm, self.state.reference);
        next.reference.advance(&self.ways(), dt);
        let dynamics = self.believed.dynamics(&before.q, &before.qd);
        let plan = self.plan();
        let torque = plan.torque(&mut next.memory, &before, &dynamics, &from, &next.reference, dt);
        let flange = dynamics.frames.flange();
        let tip = self.instrument.tip(&flange).translation;
        let external = dynamics.frames.jacobian(self.arm.dof(), tip).torque(load.force, load.torque);
        let mut touches = self.touches(&dynamics.frames, &before);
        let count = touches.count;
        let report = self.arm.step(
            &mut next.arm,
            &Drive { torque, external },
            &mut touches.couplings[..count],
            dt,
            self.settings.substeps,
        )?;
        plan.learn(&mut next.memory, &dynamics, &before, &next.arm, dt);
        let frames = self.arm.frames(&next.arm.q);
        self.port.advance(&Shaft::of(&self.instrument, &frames.flange()), &mut next.rim);
        // Force and torque about the flange's origin of what touches the instrument.
        let mut outer = [load.force, load.torque + (tip - flange.translation).cross(load.force)];
        let mut rim_force = 0.0;
        for (c, (point, direction)) in touches.couplings[..count].iter().zip(touches.places) {
            let force = c.force * direction;
            outer[0] += force;
            outer[1] += (point - flange.translation).cross(force);
            if c.law == CouplingLaw::Push {
                rim_force += c.force;
            }
        }
        next.mount = self.mount_reading(&before, &next.arm, &frames, outer, dt);
        if !next.mount.iter().all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "the force at the mount" });
        }
        let opening = self.instrument.jaw.toward(next.jaw[0], next.jaw[2], dt);
        next.jaw = [opening, (opening - next.jaw[0]) / dt, next.jaw[2]];
        self.state = next;
        let pace = next.reference.pace;
        Ok(StepReport { arm: report, rim_force, rcm_deviation: self.deviation(&frames), pace })
    }

    /// All that changes, to be kept.
    pub fn state(&self) -> ManipulatorState {
        self.state
    }

    /// Goes back to a state of this manipulator, or of one made alike.
    ///
    /// # Errors
    /// A state of an arm with another number of joints.
    pub fn restore(&mut self, state: &ManipulatorState) -> Result<()> {
        let n = self.arm.dof();
        if state.arm.q.len() != n || state.arm.qd.len() != n || state.reference.q.len() != n {
            return Err(Error::invalid("state", format!("must be that of an arm with {n} joints")));
        }
        self.state = *state;
        Ok(())
    }

    /// The arm as it is: with the instrument and the friction.
    pub fn arm(&self) -> &SerialArm {
        &self.arm
    }

    /// The arm that the controller believes in.
    pub fn believed(&self) -> &SerialArm {
        &self.believed
    }

    /// The instrument.
    pub fn instrument(&self) -> &Instrument {
        &self.instrument
    }

    /// The port.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// How it is driven.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Limits of the commanded coordinates.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    fn period(&self) -> f64 {
        1.0 / self.settings.command_rate
    }

    fn ways(&self) -> Ways<'_> {
        Ways {
            arm: &self.arm,
            instrument: &self.instrument,
            port: &self.port,
            limits: &self.limits,
            period: self.period(),
        }
    }

    fn plan(&self) -> Plan<'_> {
        Plan {
            settings: &self.settings,
            believed: &self.believed,
            inertia: &self.inertia,
            instrument: &self.instrument,
            port: &self.port,
        }
    }

    fn send(&mut self, to: &Coordinates) {
        let now = self.setpoint_coordinates();
        self.state.reference.command_coordinates(to, &now);
        self.state.jaw[2] = to.jaw;
    }

    /// As much of the way from the reference to `to` as the arm can go.
    fn reachable(&self, to: &Coordinates) -> Result<(Coordinates, f64)> {
        let reaches = |c: &Coordinates| -> Result<bool> {
            let target = self.port.flange(&self.instrument, c);
            let options = InverseOptions { tolerance: REACHED, posture_tolerance: 1e-2, ..InverseOptions::default() };
            let found = self.arm.inverse(&target, &self.state.reference.q, &options)?;
            Ok(found.reached && found.at_limit.is_empty())
        };
        if reaches(to)? {
            return Ok((*to, 1.0));
        }
        let from = self.setpoint_coordinates();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if reaches(&reference::between(&from, to, middle))? { low = middle } else { high = middle }
        }
        Ok((reference::between(&from, to, low), low))
    }
}
