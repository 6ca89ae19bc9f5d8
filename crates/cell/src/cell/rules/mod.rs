//! Safety rules: where the cell departs from plain physics, so that no command breaks tissue or
//! solver. Each rule is a file of its own, says so as an event, and is counted.
//!
//! | rule | when | what it does |
//! |---|---|---|
//! | [`force_guard`] | tissue pushes with nearly the scene's limit | shortens the command |
//! | [`pierce`] | an instrument has gone through an organ's surface | disables its contact |
//! | [`overstretch`] | tissue near an instrument is strained beyond what tissue bears | disables contact |
//! | [`reconnect`] | the instrument is out, and tissue has come back | enables contact again |
//! | [`relax`] | an organ stays folded with no instrument at it | relaxes it outside of time |
//!
//! A scene turns rules off in `[safety.rules]`. [`reconnect`] undoes what the rules did, and needs no
//! switch.
//!
//! Contact of jaws that hold by a latch is disabled in two steps: first of the blades, which keep
//! their hold, then of the whole instrument, which lets go.

mod force_guard;
mod overstretch;
mod pierce;
mod reconnect;
mod relax;
mod strain;

pub(super) use force_guard::ForceGuard;
pub(super) use strain::Edges;

use super::Cell;
use super::arm::ArmUnit;
use super::report::{CellEvent, PeriodLog};
use crate::World;
use strain::{SQUEEZED, Strain};
use trocar_robot::wrench::ForceKind;

/// What rules look at and change after a tissue frame.
struct Scope<'a> {
    world: &'a mut World,
    arms: &'a mut [ArmUnit],
    /// By body.
    strains: &'a [Strain],
    /// By body, frames for which it has been strained with no instrument at it.
    waits: &'a mut [u32],
    log: &'a mut PeriodLog,
}

impl Cell {
    /// Applies the rules on tissue after a frame whose smallest element has the share `least` of
    /// its rest volume.
    pub(super) fn enforce_tissue_limits(&mut self, least: f64, log: &mut PeriodLog) {
        let rules = self.rules;
        if !(rules.pierce || rules.overstretch || rules.relax) {
            return;
        }
        let waiting = self.waits.iter().any(|w| *w > 0);
        if least > SQUEEZED && !waiting && !self.arms.iter().any(ArmUnit::meets_tissue) {
            return;
        }
        let strains = self.edges.strains(&self.world, least);
        self.waits.resize(strains.len(), 0);
        let (world, arms, waits) = (&mut self.world, &mut self.arms[..], &mut self.waits[..]);
        let mut scope = Scope { world, arms, strains: &strains, waits, log };
        if rules.pierce {
            pierce::apply(&mut scope);
        }
        reconnect::apply(&mut scope);
        let mut relaxed = Vec::new();
        for organ in 0..strains.len() {
            match overstretch::instrument_at(&scope, organ) {
                Some(arm) if rules.overstretch => overstretch::apply(&mut scope, organ, arm),
                None if rules.relax => relaxed.extend(relax::apply(&mut scope, organ)),
                _ => {}
            }
        }
        scope.log.events.append(&mut relaxed);
    }
}

impl Scope<'_> {
    /// Disables contact of arm `k` because of `organ`: of its blades alone where a latch holds, and
    /// of the whole instrument otherwise, which then lets go.
    fn disable_contact(&mut self, k: usize, organ: usize) {
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
