//! Stage 8: measurements at the end of the period.

use crate::blades::{Tools, blade_forces, opening_force};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{ArmObservation, CellEvent, CellReport, PeriodLog, TaggedForce};
use glam::DVec3;
use trocar_core::Wrench;
use trocar_robot::wrench::ForceKind;
use trocar_tissue::ToolForce;

impl Cell {
    /// The observations of the arms at the end of the last period, the left one first.
    pub fn observe(&self) -> Vec<ArmObservation> {
        self.arms.iter().map(ArmUnit::observe).collect()
    }

    pub(super) fn observe_period(&mut self, log: PeriodLog) -> CellReport {
        let PeriodLog { mut events, tissue, rules, activation_step } = log;
        let (arms, clearance) = (self.observe(), self.clearance());
        let touch = clearance < 0.0;
        if touch && !self.touch {
            events.push(CellEvent::InstrumentsTouch { depth_mm: -1e3 * clearance });
        }
        self.touch = touch;
        CellReport { time: self.time(), arms, clearance, tissue, events, rules, activation_step }
    }
}

impl ArmUnit {
    fn observe(&self) -> ArmObservation {
        let Self { model, drive, state } = self;
        let contact: DVec3 = state.forces.iter().map(|f| f.contact.force).sum();
        let constraint: DVec3 = state.forces.iter().map(|f| f.constraint.force).sum();
        let (measured, rates) = drive.measured();
        let kind = self.force_kind();
        ArmObservation {
            side: model.side,
            measured: measured.with_jaw(self.opening()),
            rates: [rates[0], rates[1], rates[2], rates[3], state.jaw_rate],
            tip: drive.tip(),
            rcm_deviation: drive.rcm_deviation(),
            rcm_peak: state.rcm_peak,
            rcm_over_threshold: state.rcm_peak > model.rcm_limits[0],
            rcm_over_abort: state.rcm_peak > model.rcm_limits[1],
            tilt: drive.tilt(),
            commanded: state.commanded,
            rejected_rotation: state.wanted.rejected_rotation(),
            held_back: state.held_back,
            guarded: state.guarded,
            force: TaggedForce { kind, wrench: self.tissue_wrench(kind) },
            contact,
            constraint,
            solid: state.solid.force(),
            solid_peak: state.solid.peak,
            jaw_force: self.opening_force(),
            blade_forces: blade_forces(&state.gripper, Tools::of(0), &state.forces),
            load_limited: state.exchange.limited,
            attached: state.held.is_some(),
        }
    }

    /// Force with which tissue pushes the blades apart (N): from contact and from cutting.
    pub fn opening_force(&self) -> f64 {
        let state = &self.state;
        let cut = state.bite.as_ref().map_or(0.0, |bite| bite.force);
        opening_force(&state.gripper, Tools::of(0), &state.forces) + cut
    }

    /// The wrench of tissue on the instrument, of one kind, about the tip and in the cell's axes.
    pub fn tissue_wrench(&self, kind: ForceKind) -> Wrench {
        let part = |f: &ToolForce| match kind {
            ForceKind::Constraint => f.constraint,
            ForceKind::Contact => f.contact,
        };
        let parts = self.state.forces.iter().map(part);
        parts.fold(Wrench::default(), |sum, w| sum + w)
    }
}
