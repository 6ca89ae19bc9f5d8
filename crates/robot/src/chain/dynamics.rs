//! Dynamics: mass matrix, bias forces, inverse and forward dynamics.
//!
//! The recursions run in world axes about each link's centre of mass. For a chain this costs little
//! more than link axes and needs no transforms: Newton-Euler outwards and inwards (Lynch and Park
//! 2017, section 8.3; Featherstone 2008, section 5.3) and composite rigid bodies (Featherstone
//! 2008, section 6.2). A rotor adds its armature to its own joint only.

use super::arm::SerialArm;
use super::frames::Frames;
use super::joints::{Joints, MAX_JOINTS};
use super::mass::point_inertia;
use super::matrix::JointMatrix;
use crate::{Error, Result};
use glam::{DMat3, DVec3};

/// An external force and torque on a link, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkLoad {
    /// Index of the link, 0 for the first moving link; an index beyond the last is the last.
    pub link: usize,
    /// Point of the force, in the world (m).
    pub point: DVec3,
    /// Force (N).
    pub force: DVec3,
    /// Torque (N m).
    pub torque: DVec3,
}

/// The dynamics of an arm in one state: M(q) qdd + bias = torque.
#[derive(Clone, Copy, Debug)]
pub struct Dynamics {
    /// Poses of the links.
    pub frames: Frames,
    /// Mass matrix M(q), with the rotors' armature (kg m2, kg m or kg).
    pub mass_matrix: JointMatrix,
    /// Coriolis, centrifugal and gravity torques (N m or N).
    pub bias: Joints,
}

/// Centres of mass and inertias in world axes.
struct Bodies {
    centers: [DVec3; MAX_JOINTS],
    inertias: [DMat3; MAX_JOINTS],
}

impl SerialArm {
    /// Frames, mass matrix and bias at positions `q` and rates `qd`.
    pub fn dynamics(&self, q: &Joints, qd: &Joints) -> Dynamics {
        let frames = self.frames(q);
        let bodies = self.place(&frames);
        let mass_matrix = self.composite(&frames, &bodies);
        let bias = self.newton_euler(&frames, &bodies, qd, &self.zeros(), self.gravity());
        Dynamics { frames, mass_matrix, bias }
    }

    /// Mass matrix M(q), with the rotors' armature (kg m2, kg m or kg).
    pub fn mass_matrix(&self, q: &Joints) -> JointMatrix {
        let frames = self.frames(q);
        self.composite(&frames, &self.place(&frames))
    }

    /// Coriolis, centrifugal and gravity torques at rates `qd`: they give zero acceleration (N m or
    /// N).
    pub fn bias(&self, q: &Joints, qd: &Joints) -> Joints {
        self.inverse_dynamics(q, qd, &self.zeros())
    }

    /// The torques that hold the arm against gravity (N m or N).
    pub fn gravity_torque(&self, q: &Joints) -> Joints {
        self.inverse_dynamics(q, &self.zeros(), &self.zeros())
    }

    /// The torques for the accelerations `qdd`, without damping and friction of the joints (N m or
    /// N).
    pub fn inverse_dynamics(&self, q: &Joints, qd: &Joints, qdd: &Joints) -> Joints {
        let frames = self.frames(q);
        self.newton_euler(&frames, &self.place(&frames), qd, qdd, self.gravity())
    }

    /// The accelerations under joint torques and loads on links, without damping, friction and
    /// limits of the joints (see [`SerialArm::step`]).
    ///
    /// # Errors
    /// A mass matrix that is not positive definite, because of a number that is not finite.
    pub fn forward_dynamics(&self, q: &Joints, qd: &Joints, torque: &Joints, loads: &[LinkLoad]) -> Result<Joints> {
        let d = self.dynamics(q, qd);
        let mut drive = Joints::from_fn(self.dof(), |i| torque.at(i) - d.bias.at(i));
        for load in loads {
            let t = d.frames.jacobian(load.link, load.point).torque(load.force, load.torque);
            for (x, t) in drive.iter_mut().zip(t.iter()) {
                *x += t;
            }
        }
        let factor = d.mass_matrix.factor().ok_or(Error::NotFinite { what: "the mass matrix or its inverse" })?;
        let qdd = factor.solve(&drive);
        if qdd.is_finite() { Ok(qdd) } else { Err(Error::NotFinite { what: "an acceleration" }) }
    }

    /// Kinetic and potential energy (J); the latter is zero for masses at the world's origin.
    pub fn energy(&self, q: &Joints, qd: &Joints) -> (f64, f64) {
        let frames = self.frames(q);
        let bodies = self.place(&frames);
        let kinetic = 0.5 * qd.dot(&self.composite(&frames, &bodies).times(qd));
        let potential = self.bodies().iter().zip(&bodies.centers).map(|(b, c)| -b.mass * self.gravity().dot(*c)).sum();
        (kinetic, potential)
    }

    fn place(&self, frames: &Frames) -> Bodies {
        let mut placed = Bodies { centers: [DVec3::ZERO; MAX_JOINTS], inertias: [DMat3::ZERO; MAX_JOINTS] };
        for (i, body) in self.bodies().iter().enumerate() {
            let pose = frames.link(i);
            let r = DMat3::from_quat(pose.rotation);
            placed.centers[i] = r * body.center + pose.translation;
            placed.inertias[i] = r * body.inertia * r.transpose();
        }
        placed
    }

    /// The torques for rates `qd` and accelerations `qdd`. Gravity is an acceleration of the base
    /// against it.
    fn newton_euler(&self, frames: &Frames, bodies: &Bodies, qd: &Joints, qdd: &Joints, gravity: DVec3) -> Joints {
        let n = self.dof();
        let mut forces = [DVec3::ZERO; MAX_JOINTS];
        let mut moments = [DVec3::ZERO; MAX_JOINTS];
        // Of the link before: angular velocity and acceleration, acceleration of its origin.
        let (mut w, mut dw, mut a) = (DVec3::ZERO, DVec3::ZERO, -gravity);
        let mut origin = self.base().translation;
        for i in 0..n {
            let z = frames.axis(i);
            let here = frames.link(i).translation;
            let r = here - origin;
            a += dw.cross(r) + w.cross(w.cross(r));
            if frames.turns(i) {
                dw += z * qdd.at(i) + w.cross(z) * qd.at(i);
                w += z * qd.at(i);
            } else {
                a += z * qdd.at(i) + 2.0 * qd.at(i) * w.cross(z);
            }
            origin = here;
            let c = bodies.centers[i] - here;
            forces[i] = self.bodies()[i].mass * (a + dw.cross(c) + w.cross(w.cross(c)));
            moments[i] = bodies.inertias[i] * dw + w.cross(bodies.inertias[i] * w);
        }
        let mut torque = self.zeros();
        let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        let mut outer = DVec3::ZERO;
        for i in (0..n).rev() {
            let here = frames.link(i).translation;
            // Moves force and moment of the outer links from the next origin to this one.
            moment += (outer - here).cross(force);
            moment += moments[i] + (bodies.centers[i] - here).cross(forces[i]);
            force += forces[i];
            outer = here;
            let z = frames.axis(i);
            torque[i] = if frames.turns(i) { z.dot(moment) } else { z.dot(force) };
            torque[i] += self.segments()[i].joint.armature * qdd.at(i);
        }
        torque
    }

    /// The mass matrix, from the composite body that each joint moves.
    fn composite(&self, frames: &Frames, bodies: &Bodies) -> JointMatrix {
        let n = self.dof();
        let mut m = JointMatrix::zeros(n);
        let (mut mass, mut center, mut inertia) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for j in (0..n).rev() {
            let (added, d) = (self.bodies()[j].mass, bodies.centers[j] - center);
            let sum: f64 = mass + added;
            inertia += bodies.inertias[j];
            if sum > 0.0 {
                inertia += point_inertia(mass * added / sum, d);
                center += d * (added / sum);
            }
            mass = sum;
            // Momentum of the composite at unit speed of joint j; angular about its centre.
            let z = frames.axis(j);
            let (p, l) = if frames.turns(j) {
                (mass * z.cross(center - frames.link(j).translation), inertia * z)
            } else {
                (mass * z, DVec3::ZERO)
            };
            for i in 0..=j {
                let axis = frames.axis(i);
                let value = if frames.turns(i) {
                    axis.dot(l + (center - frames.link(i).translation).cross(p))
                } else {
                    axis.dot(p)
                };
                m.set(i, j, value);
            }
            m.add_diagonal(j, self.segments()[j].joint.armature);
        }
        m
    }
}
