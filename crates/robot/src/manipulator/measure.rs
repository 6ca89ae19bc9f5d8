//! Measurements and setpoints of a manipulator, by CRTK's names.

use super::controlled_arm::Manipulator;
use super::reference;
use crate::chain::{ArmState, Frames, Joints};
use crate::instrument::{Coordinates, compose};
use crate::port::{Measured, Shaft, Twist};
use glam::{DMat3, DVec3};
use trocar_core::{Pose, Wrench};

/// Readings of the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointReadings {
    /// Positions (rad or m).
    pub position: Joints,
    /// Rates (rad/s or m/s).
    pub velocity: Joints,
    /// Torques of the drives (N m or N).
    pub effort: Joints,
}

impl Manipulator {
    /// The measured joints.
    pub fn measured_js(&self) -> JointReadings {
        let s = &self.state;
        JointReadings { position: s.arm.q, velocity: s.arm.qd, effort: s.memory.torque }
    }

    /// The reference of the joints; the effort is the last torque.
    pub fn setpoint_js(&self) -> JointReadings {
        let s = &self.state;
        JointReadings { position: s.reference.q, velocity: s.reference.qd, effort: s.memory.torque }
    }

    /// Pose of the tip in the cell.
    pub fn measured_cp(&self) -> Pose {
        self.instrument.tip(&self.flange())
    }

    /// Pose of the tip in the reference, which the filter delays behind the command.
    pub fn setpoint_cp(&self) -> Pose {
        self.instrument.tip(&self.arm.frames(&self.state.reference.q).flange())
    }

    /// Twist of the tip at the jaw's pivot, in the cell.
    pub fn measured_cv(&self) -> Twist {
        let frames = self.arm.frames(&self.state.arm.q);
        let tip = self.instrument.tip(&frames.flange()).translation;
        let (linear, angular) = frames.jacobian(self.arm.dof(), tip).velocity(&self.state.arm.qd);
        Twist { linear, angular }
    }

    /// The reading of a six-axis sensor at the mount, mean over the last step: the wrench of the
    /// instrument on the mount, with its weight and inertia, the load on its tip and the rim's
    /// forces. In the flange's frame, torque about its origin, as in
    /// [`LoadModel`](crate::wrench::LoadModel).
    pub fn measured_cf(&self) -> Wrench {
        let turn = self.flange().rotation.inverse();
        let [force, torque] = self.state.mount;
        Wrench { force: turn * force, torque: turn * torque }
    }

    /// Pose of the flange in the cell.
    pub fn flange(&self) -> Pose {
        self.arm.frames(&self.state.arm.q).flange()
    }

    /// The shaft in the cell.
    pub fn shaft(&self) -> Shaft {
        Shaft::of(&self.instrument, &self.flange())
    }

    /// The measured coordinates of the instrument, and their rates: pivots (rad/s), insertion
    /// (m/s), roll (rad/s), jaw (1/s). If the shaft does not point into the body, which only joint
    /// commands can cause, they are those of the reference at rest.
    pub fn coordinates(&self) -> (Coordinates, [f64; 5]) {
        let frames = self.arm.frames(&self.state.arm.q);
        let flange = frames.flange();
        let (linear, angular) = frames.flange_jacobian().velocity(&self.state.arm.qd);
        let jaw = self.state.jaw;
        let measured = self.port.measure(&self.instrument, &flange, jaw[0]);
        let rates = self.port.rates(&self.instrument, &flange, &Twist { linear, angular });
        match (measured, rates) {
            (Ok(m), Ok([a, b, c, d])) => (m.coordinates, [a, b, c, d, jaw[1]]),
            _ => (self.setpoint_coordinates(), [0.0; 5]),
        }
    }

    /// The instrument in its port; `None` if the shaft does not point into the body.
    pub fn in_port(&self) -> Option<Measured> {
        self.port.measure(&self.instrument, &self.flange(), self.state.jaw[0]).ok()
    }

    /// The coordinates of the reference; the jaw's opening is the commanded one.
    pub fn setpoint_coordinates(&self) -> Coordinates {
        let (r, jaw) = (&self.state.reference, self.state.jaw[2]);
        let own = reference::unpack(&r.value, jaw);
        if !r.in_joints() {
            return own;
        }
        let flange = self.arm.frames(&r.q).flange();
        match self.port.measure(&self.instrument, &flange, jaw) {
            Ok(m) => self.limits.clamp(&m.coordinates).0,
            // A shaft that joint commands have pulled out returns upright.
            Err(_) => Coordinates { insertion: self.limits.insertion[0], jaw, ..Coordinates::default() },
        }
    }

    /// The coordinates of the last command, after limits.
    pub fn commanded(&self) -> Coordinates {
        let (r, jaw) = (&self.state.reference, self.state.jaw[2]);
        if r.in_joints() { self.setpoint_coordinates() } else { reference::unpack(&r.target, jaw) }
    }

    /// Distance from the port's centre to the shaft's axis, in the port's plane (m).
    pub fn rcm_deviation(&self) -> f64 {
        self.deviation(&self.arm.frames(&self.state.arm.q))
    }

    /// Angle between shaft and port normal (rad).
    pub fn tilt(&self) -> f64 {
        self.shaft().direction.angle_between(self.port.normal())
    }

    /// The jaw's opening, in [0, 1].
    pub fn jaw(&self) -> f64 {
        self.state.jaw[0]
    }

    pub(super) fn deviation(&self, frames: &Frames) -> f64 {
        let flange = frames.flange();
        match self.port.measure(&self.instrument, &flange, 0.0) {
            Ok(m) => m.deviation(),
            // A shaft along the plane may not cross it: its distance from the centre is used.
            Err(_) => {
                let shaft = Shaft::of(&self.instrument, &flange);
                (self.port.centre() - shaft.base).cross(shaft.direction).length()
            }
        }
    }

    /// The wrench of the instrument on the mount: its weight and the external wrench `outer`
    /// (force, and torque about the flange's origin at the start of the step) minus the change of
    /// momentum (Newton-Euler). In the cell's axes.
    pub(super) fn mount_reading(
        &self,
        before: &ArmState,
        after: &ArmState,
        frames: &Frames,
        outer: [DVec3; 2],
        dt: f64,
    ) -> [DVec3; 2] {
        let earlier = self.arm.frames(&before.q);
        let mass = self.instrument.mass_in_flange();
        let momentum = |frames: &Frames, qd: &Joints| {
            let flange = frames.flange();
            let body = mass.placed(&compose(&flange, &Pose::IDENTITY));
            let turn = DMat3::from_quat(flange.rotation);
            let inertia = turn * mass.inertia * turn.transpose();
            let (linear, angular) = frames.jacobian(self.arm.dof(), body.center).velocity(qd);
            (body.center, mass.mass * linear, inertia * angular)
        };
        let (center, p0, l0) = momentum(&earlier, &before.qd);
        let (_, p1, l1) = momentum(frames, &after.qd);
        let (push, spin) = ((p1 - p0) / dt, (l1 - l0) / dt);
        let at = center - earlier.flange().translation;
        let weight = mass.mass * self.arm.gravity();
        let force = weight + outer[0] - push;
        [force, outer[1] + at.cross(weight - push) - spin]
    }
}
