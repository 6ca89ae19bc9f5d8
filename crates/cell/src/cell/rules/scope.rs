//! The parts of a cell that a rule on tissue reads and changes.

use super::strain::Strain;
use crate::World;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{CellEvent, PeriodLog};
use trocar_robot::wrench::ForceKind;

/// The parts that rules read and change after a frame of tissue.
pub(super) struct Scope<'a> {
    pub world: &'a mut World,
    pub arms: &'a mut [ArmUnit],
    /// By body.
    pub strains: &'a [Strain],
    /// By body: frames for which it has been strained without an instrument at it.
    pub waits: &'a mut [u32],
    pub log: &'a mut PeriodLog,
}

impl Scope<'_> {
    /// Disables contact of arm `k` because of `organ`: that of its blades if they are latched, else
    /// that of the whole instrument, which then releases its grasp.
    pub fn disable_contact(&mut self, k: usize, organ: usize) {
        let arm = &mut self.arms[k];
        let (side, name) = (arm.model.side, self.world.model.bodies()[organ].name().to_owned());
        let Strain { stretch, volume, .. } = self.strains[organ];
        let latched = !arm.state.blades_disabled && arm.force_kind() == ForceKind::Constraint;
        if latched {
            arm.state.blades_disabled = true;
            self.log.rules.disabled_blades += 1;
            self.log.events.push(CellEvent::BladesDisabled { arm: side, organ: name, stretch, volume });
            return;
        }
        arm.let_go(self.world, &mut self.log.events);
        arm.state.contact_disabled = true;
        self.log.rules.disabled_contacts += 1;
        self.log.events.push(CellEvent::ContactDisabled { arm: side, organ: name, stretch, volume });
    }
}
