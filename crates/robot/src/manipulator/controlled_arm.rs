//! The controlled arm: commands, and the physics step.

use super::control::{Controller, Memory};
use super::obstacle::Obstacle;
use super::reference::{Reference, ReferenceContext, between};
use super::settings::ControllerSettings;
use crate::chain::{self, ArmState, CouplingLaw, Drive, InverseOptions, JointSet, Joints, SerialArm};
use crate::instrument::{Coordinates, Excess, Instrument, Limits, clamp_unit};
use crate::port::{Port, RimState, Shaft};
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_core::{Pose, Wrench};

/// Maximum physics step (s).
const MAX_STEP: f64 = 0.02;
/// Tolerances of a commanded pose of the flange (m, rad).
const POSE_TOLERANCE: [f64; 2] = [1e-6, 1e-5];
/// Bisections of the path to a command that the arm cannot reach.
const REACH_BISECTIONS: usize = 6;
/// Number of postures from which the start posture is searched.
pub(super) const START_SEARCHES: usize = 24;

/// A controlled arm with its instrument in its port.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use trocar_core::{Pose, Wrench};
/// use trocar_robot::chain::SerialArm;
/// use trocar_robot::instrument::{Coordinates, Instrument};
/// use trocar_robot::manipulator::{ControllerSettings, Manipulator};
/// use trocar_robot::port::Port;
///
/// let rotation = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
/// let base = Pose { rotation, translation: DVec3::new(-0.45, 0.0, 0.0) };
/// let arm = SerialArm::franka_fr3()?.with_base(base)?;
/// let port = Port::new(DVec3::new(-0.045, 0.46, 0.16), -DVec3::Z, DVec3::X)?;
/// let start = Coordinates { pivots: [0.0, 0.23], insertion: 0.1, roll: 0.0, jaw: 0.5 };
/// let settings = ControllerSettings::default();
/// let mut arm = Manipulator::new(arm, Instrument::grasper(), port, settings, start)?;
///
/// // Inserts the instrument by 5 mm within half a second.
/// arm.servo_cp(&Coordinates { insertion: 0.105, ..start })?;
/// for _ in 0..240 {
///     arm.step(Wrench::default(), 1.0 / 480.0)?;
/// }
/// assert!((arm.coordinates().0.insertion - 0.105).abs() < 1e-3);
/// assert!(arm.rcm_deviation() < 1e-3);
/// # Ok::<(), trocar_robot::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Manipulator {
    /// The actual arm, with the instrument as its payload.
    pub(super) arm: SerialArm,
    /// The controller's model of the arm.
    pub(super) believed: SerialArm,
    pub(super) instrument: Instrument,
    pub(super) port: Port,
    pub(super) settings: ControllerSettings,
    pub(super) limits: Limits,
    /// The joints' diagonal inertias in the start posture (kg m2 or kg).
    pub(super) inertia: Joints,
    pub(super) state: ManipulatorState,
}

/// The state of a [`Manipulator`]. Plain data: a copy is an exact snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManipulatorState {
    pub(super) arm: ArmState,
    pub(super) reference: Reference,
    pub(super) memory: Memory,
    pub(super) rim: RimState,
    /// Opening of the jaw, its rate (1/s) and its target.
    pub(super) jaw: [f64; 3],
    /// Mean force (N) and torque (N m) at the mount over the last step, in the cell's axes.
    pub(super) mount: [DVec3; 2],
}

impl ManipulatorState {
    /// Every number of it, for hashes.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self { arm: ArmState { q, qd }, reference, memory, rim, jaw, mount: [force, torque] } = self;
        let arm = q.iter().chain(qd.iter()).copied();
        let mount = force.to_array().into_iter().chain(torque.to_array());
        arm.chain(reference.numbers()).chain(memory.numbers()).chain(rim.numbers()).chain(*jaw).chain(mount)
    }
}

/// Result of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commanded {
    /// The accepted coordinates, within the limits and the arm's reach.
    pub coordinates: Coordinates,
    /// By how much the command exceeds each limit.
    pub excess: Excess,
    /// Share of the path to the limited command that the arm can reach, in [0, 1].
    pub reach: f64,
    /// The rejected part of a commanded orientation: axis times angle (rad), in the cell. Zero for
    /// commands of coordinates.
    pub rejected_rotation: DVec3,
    /// The rejected part of a commanded position (m), in the cell, because of a limit or the arm's
    /// reach. Zero for commands of coordinates.
    pub rejected_translation: DVec3,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManipulatorReport {
    /// Report of the arm: torques, joints at limits.
    pub arm: chain::ArmStepReport,
    /// Normal force of the shaft on the rim (N), summed over contacts, mean over the step.
    pub rim_force: f64,
    /// Distance from the port's centre to the shaft's axis, in the port's plane (m), at the end of
    /// the step.
    pub rcm_deviation: f64,
    /// Speed of the reference's time, below 1 if the arm cannot follow.
    pub pace: f64,
}

impl ManipulatorReport {
    /// Joints that a position limit stopped.
    pub fn stopped(&self) -> JointSet {
        self.arm.at_position_limit
    }
}

impl Manipulator {
    /// `arm` at its base in the cell, with `instrument` as its payload, through `port`, at rest at
    /// `start`. The arm's home posture chooses the elbow.
    ///
    /// # Errors
    /// An invalid part; a start outside the limits or out of reach.
    pub fn new(
        arm: SerialArm,
        instrument: Instrument,
        port: Port,
        settings: ControllerSettings,
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
        let options = InverseOptions { restarts: START_SEARCHES, tolerance: [1e-9, 1e-9], ..InverseOptions::default() };
        let found = arm.inverse(&target, &arm.home(), &options)?;
        if !found.reached {
            let reason = format!(
                "the flange of arm '{}' would be {:.1} mm from its pose; move the base nearer",
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
        // The reading at rest, before the first step.
        let at = made.state.arm;
        made.state.mount = made.mount_reading(&at, &at, &made.arm.frames(&at.q), [DVec3::ZERO; 2], 1.0);
        Ok(made)
    }

    /// Commands absolute coordinates of the instrument. The result has the parts beyond limits.
    ///
    /// # Errors
    /// A number that is not finite. The state is then unchanged.
    pub fn servo_cp(&mut self, target: &Coordinates) -> Result<Commanded> {
        let target = Coordinates::from_action(target.to_action())?;
        let (kept, excess) = self.limits.clamp(&target);
        let (coordinates, reach) = self.reachable(&kept)?;
        self.send(&coordinates);
        Ok(Commanded { coordinates, excess, reach, rejected_rotation: DVec3::ZERO, rejected_translation: DVec3::ZERO })
    }

    /// Commands a pose of the tip in the cell, and the jaw's opening. Position has priority; the
    /// result has the part of the orientation that four degrees of freedom cannot reach.
    ///
    /// # Errors
    /// A number that is not finite, a rotation that is not of unit length. The state is then
    /// unchanged.
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
                chain::rotation_vector(target.rotation * tip.rotation.inverse())
            },
            rejected_translation: target.translation - tip.translation,
        })
    }

    /// Commands the joints (rad or m). Then only the rim keeps the shaft in the port.
    ///
    /// # Errors
    /// Another number of joints, or a position that is not finite or outside the limits. The state
    /// is then unchanged.
    pub fn servo_jp(&mut self, target: &[f64]) -> Result<()> {
        let target = self.arm.posture(target)?;
        self.state.reference.command_joints(&target, self.period());
        Ok(())
    }

    /// Stops the reference where it is; a command of coordinates or joints then starts from rest.
    /// The arm itself comes to rest within its tracking error.
    pub fn halt(&mut self) {
        let period = self.period();
        self.state.reference.halt(period);
    }

    /// Commands only the jaw's opening, clamped to [0, 1].
    ///
    /// # Errors
    /// A number that is not finite. The state is then unchanged.
    pub fn servo_jaw(&mut self, opening: f64) -> Result<()> {
        if !opening.is_finite() {
            return Err(Error::NotFinite { what: "the jaw's opening" });
        }
        self.state.jaw[2] = clamp_unit(opening);
        Ok(())
    }

    /// One physics step of `dt` (s), for example 1/480 s. `load` acts on the instrument's tip: a
    /// force (N) at the jaw's pivot and a torque (N m) about it, in the cell's axes.
    ///
    /// # Errors
    /// A step outside (0, 20] ms, a load that is not finite, or one so large that the result is not
    /// finite. The state is then unchanged.
    pub fn step(&mut self, load: Wrench, dt: f64) -> Result<ManipulatorReport> {
        self.step_among(load, &mut [], dt)
    }

    /// The same step with solid `obstacles` that the instrument may press on. Their forces are
    /// written into them.
    ///
    /// # Errors
    /// As [`step`](Self::step); more than [`MAX_OBSTACLES`](super::MAX_OBSTACLES) obstacles, or an
    /// invalid one. State and obstacles are then unchanged.
    pub fn step_among(&mut self, load: Wrench, obstacles: &mut [Obstacle], dt: f64) -> Result<ManipulatorReport> {
        if !(dt > 0.0 && dt <= MAX_STEP) {
            return Err(Error::invalid("step", format!("is {dt} s; it must be in (0, {MAX_STEP}] s")));
        }
        if !load.is_finite() {
            return Err(Error::NotFinite { what: "the load on the tip" });
        }
        let mut next = self.state;
        let (before, from) = (self.state.arm, self.state.reference);
        next.reference.advance(&self.reference_context(), dt);
        let dynamics = self.believed.dynamics(&before.q, &before.qd);
        let controller = self.controller();
        let torque = controller.torque(&mut next.memory, &before, &dynamics, &from, &next.reference, dt);
        let flange = dynamics.frames.flange();
        let tip = self.instrument.tip(&flange).translation;
        let external = dynamics.frames.jacobian(self.arm.dof(), tip).torque(load.force, load.torque);
        let mut touches = self.touches(&dynamics.frames, &before);
        let rims = touches.count;
        self.meet(obstacles, &dynamics.frames, &mut touches, dt)?;
        let count = touches.count;
        let report = self.arm.step(
            &mut next.arm,
            &Drive { torque, external },
            &mut touches.couplings[..count],
            dt,
            self.settings.substeps,
        )?;
        controller.observe(&mut next.memory, &dynamics, &before, &next.arm, dt);
        let frames = self.arm.frames(&next.arm.q);
        self.port.advance(&Shaft::of(&self.instrument, &frames.flange()), &mut next.rim);
        // External force and torque on the instrument, about the flange's origin.
        let mut outer = [load.force, load.torque + (tip - flange.translation).cross(load.force)];
        let mut rim_force = 0.0;
        for (k, (c, (point, direction))) in touches.couplings[..count].iter().zip(touches.places).enumerate() {
            let force = c.force * direction;
            outer[0] += force;
            outer[1] += (point - flange.translation).cross(force);
            if k < rims && c.law == CouplingLaw::Push {
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
        for (obstacle, coupling) in obstacles.iter_mut().zip(&touches.couplings[rims..count]) {
            obstacle.force = coupling.force;
        }
        let pace = next.reference.pace;
        Ok(ManipulatorReport { arm: report, rim_force, rcm_deviation: self.deviation(&frames), pace })
    }

    /// A snapshot of the state.
    pub fn state(&self) -> ManipulatorState {
        self.state
    }

    /// Restores a state of this manipulator, or of an identical one.
    ///
    /// # Errors
    /// A state of an arm with another number of joints.
    pub fn restore(&mut self, state: &ManipulatorState) -> Result<()> {
        let n = self.arm.dof();
        if state.arm.q.len() != n || state.arm.qd.len() != n || state.reference.q.len() != n {
            return Err(Error::invalid("state", format!("must have {n} joints, like the arm")));
        }
        self.state = *state;
        Ok(())
    }

    /// The actual arm, with instrument and friction.
    pub fn arm(&self) -> &SerialArm {
        &self.arm
    }

    /// The controller's model of the arm.
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

    /// The settings of the controller.
    pub fn settings(&self) -> &ControllerSettings {
        &self.settings
    }

    /// Limits of the commanded coordinates.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    pub(super) fn period(&self) -> f64 {
        1.0 / self.settings.command_rate
    }

    fn reference_context(&self) -> ReferenceContext<'_> {
        ReferenceContext {
            arm: &self.arm,
            instrument: &self.instrument,
            port: &self.port,
            limits: &self.limits,
            period: self.period(),
        }
    }

    fn controller(&self) -> Controller<'_> {
        Controller {
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

    /// The part of the path from the reference to `to` that the arm can reach, and its share.
    fn reachable(&self, to: &Coordinates) -> Result<(Coordinates, f64)> {
        let reaches = |c: &Coordinates| -> Result<bool> {
            let target = self.port.flange(&self.instrument, c);
            let options =
                InverseOptions { tolerance: POSE_TOLERANCE, posture_tolerance: 1e-2, ..InverseOptions::default() };
            let found = self.arm.inverse(&target, &self.state.reference.q, &options)?;
            Ok(found.reached && found.at_limit.is_empty())
        };
        if reaches(to)? {
            return Ok((*to, 1.0));
        }
        let from = self.setpoint_coordinates();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..REACH_BISECTIONS {
            let middle = 0.5 * (low + high);
            if reaches(&between(&from, to, middle))? { low = middle } else { high = middle }
        }
        Ok((between(&from, to, low), low))
    }
}
