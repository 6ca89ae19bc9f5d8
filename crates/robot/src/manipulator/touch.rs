//! Contacts of the instrument, as couplings for the arm's step: of the shaft with the rim, and of
//! any point with solid obstacles.

use super::controlled_arm::Manipulator;
use super::obstacle::{MAX_OBSTACLES, Obstacle};
use crate::chain::{ArmState, Coupling, CouplingLaw, Frames, MAX_COUPLINGS};
use crate::port::{Shaft, Twist};
use crate::{Error, Result};
use glam::DVec3;

/// Maximum gap at which the shaft may touch the rim within a step (m).
const MAX_GAP: f64 = 2e-3;

impl Manipulator {
    /// The contacts of the shaft with the rim, present or possible within the step, as couplings: a
    /// push, and friction along the shaft.
    pub(super) fn touches(&self, frames: &Frames, state: &ArmState) -> Touches {
        let flange = frames.flange();
        let shaft = Shaft::of(&self.instrument, &flange);
        let none = Coupling::new(self.arm.zeros(), 0.0, 0.0, CouplingLaw::Push);
        let mut touches =
            Touches { couplings: [none; MAX_COUPLINGS], places: [(DVec3::ZERO, DVec3::ZERO); MAX_COUPLINGS], count: 0 };
        let (linear, angular) = frames.jacobian(self.arm.dof(), shaft.base).velocity(&state.qd);
        let contacts = self.port.contacts(&shaft, &Twist { linear, angular }, &self.state.rim);
        for contact in contacts.iter().filter(|c| c.at.gap < MAX_GAP) {
            let jacobian = frames.jacobian(self.arm.dof(), contact.at.point);
            let of = touches.count;
            touches.add(
                Coupling {
                    damping: if contact.at.gap < 0.0 { self.port.damping } else { 0.0 },
                    ..Coupling::new(
                        jacobian.row(contact.at.normal),
                        contact.at.gap,
                        self.port.stiffness,
                        CouplingLaw::Push,
                    )
                },
                (contact.at.point, contact.at.normal),
            );
            let law = CouplingLaw::Friction { of, coefficient: self.port.friction };
            let row = jacobian.row(shaft.direction);
            touches.add(
                Coupling {
                    damping: self.port.friction_damping,
                    ..Coupling::new(row, contact.stretch, self.port.friction_stiffness, law)
                },
                (contact.at.point, shaft.direction),
            );
        }
        touches
    }

    /// Adds `obstacles` to the couplings of a step of `dt` (s).
    pub(super) fn meet(&self, obstacles: &[Obstacle], frames: &Frames, touches: &mut Touches, dt: f64) -> Result<()> {
        if obstacles.len() > MAX_OBSTACLES {
            let reason = format!("there are {}; the maximum is {MAX_OBSTACLES}", obstacles.len());
            return Err(Error::invalid("obstacles", reason));
        }
        for (k, o) in obstacles.iter().enumerate() {
            o.check(k)?;
            // The obstacle's own motion in the step shortens the gap from the beginning; its speed
            // is taken off the damper's.
            let displacement = o.gap - o.speed * (dt + o.damping / o.stiffness);
            let row = frames.jacobian(self.arm.dof(), o.point).row(o.normal);
            let coupling = Coupling::new(row, displacement, o.stiffness, CouplingLaw::Push);
            touches.add(Coupling { damping: o.damping, ..coupling }, (o.point, o.normal));
        }
        Ok(())
    }

    /// The mass (kg) that a force at `point` (m) of the instrument along the unit vector
    /// `direction` accelerates, in the cell: 1 / (J M^-1 J^T) with the arm's mass matrix M and the
    /// row J of the point's Jacobian (Khatib 1987). Infinite if the arm cannot move that way.
    pub fn reflected_mass(&self, point: DVec3, direction: DVec3) -> f64 {
        let q = &self.state.arm.q;
        let row = self.arm.frames(q).jacobian(self.arm.dof(), point).row(direction);
        let given = self.arm.mass_matrix(q).factor().map_or(0.0, |factor| row.dot(&factor.solve(&row)));
        if given > 0.0 { given.recip() } else { f64::INFINITY }
    }
}

/// Couplings of an instrument with rim and obstacles, with their points (m) and directions.
pub(super) struct Touches {
    pub couplings: [Coupling; MAX_COUPLINGS],
    pub places: [(DVec3, DVec3); MAX_COUPLINGS],
    pub count: usize,
}

impl Touches {
    pub fn add(&mut self, coupling: Coupling, place: (DVec3, DVec3)) {
        if self.count < MAX_COUPLINGS {
            (self.couplings[self.count], self.places[self.count]) = (coupling, place);
            self.count += 1;
        }
    }
}
