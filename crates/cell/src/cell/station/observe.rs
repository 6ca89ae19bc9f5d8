//! What is measured of an arm.

use super::{Station, Wanted};
use crate::GraspDesign;
use crate::blades::{Tools, opening_force};
use crate::cell::report::{ArmObservation, TaggedForce};
use glam::DVec3;
use trocar_core::Wrench;
use trocar_robot::instrument::Coordinates;
use trocar_robot::wrench::ForceKind;
use trocar_tissue::ToolForce;

impl Station {
    /// What is measured at the end of a control period.
    pub fn observe(&self) -> ArmObservation {
        let Self { fixed, now, .. } = self;
        let contact: DVec3 = now.forces.iter().map(|f| f.contact.force).sum();
        let constraint: DVec3 = now.forces.iter().map(|f| f.constraint.force).sum();
        let sum = |part: fn(&ToolForce) -> trocar_core::Wrench| {
            now.forces
                .iter()
                .map(part)
                .fold(Wrench::default(), |sum, w| sum + Wrench { force: w.force, torque: w.torque })
        };
        let kind = self.force_kind();
        let wrench = match kind {
            ForceKind::Constraint => sum(|f| f.constraint),
            ForceKind::Contact => sum(|f| f.contact),
        };
        let (measured, rates) = self.manipulator.coordinates();
        let rejected_rotation = match now.wanted {
            Wanted::Coordinates(_, rejected) => rejected,
            Wanted::Joints(_) => DVec3::ZERO,
        };
        ArmObservation {
            side: fixed.side,
            coordinates: Coordinates { jaw: self.opening(), ..measured },
            rates: [rates[0], rates[1], rates[2], rates[3], now.jaw_rate],
            tip: self.manipulator.measured_cp(),
            rcm_deviation: self.manipulator.rcm_deviation(),
            rcm_peak: now.rcm_peak,
            rcm_over_threshold: now.rcm_peak > fixed.rcm[0],
            rcm_over_abort: now.rcm_peak > fixed.rcm[1],
            tilt: self.manipulator.tilt(),
            commanded: now.commanded,
            rejected_rotation,
            held_back: now.held_back,
            guarded: now.guarded,
            force: TaggedForce { kind, wrench },
            contact,
            constraint,
            jaw_force: opening_force(&now.gripper, Tools::of(0), &now.forces),
            load_limited: now.exchange.limited,
            attached: now.held.is_some(),
        }
    }

    /// Contact, or the constraint of a latched grasp.
    pub fn force_kind(&self) -> ForceKind {
        match &self.now.held {
            Some(_) if self.now.design != GraspDesign::Friction => ForceKind::Constraint,
            _ => ForceKind::Contact,
        }
    }
}
