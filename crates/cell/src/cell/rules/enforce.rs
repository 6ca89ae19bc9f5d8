//! Applies the rules on tissue after a frame.

use super::scope::Scope;
use super::strain::SQUEEZED;
use super::tissue_at_arm::TissueAtArm;
use super::{overstretch, pierce, reconnect, relax};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;

impl Cell {
    /// Applies the rules on tissue after a frame whose smallest element has the share `least` of
    /// its rest volume. Returns the strain of the tissue at each arm, or
    /// none of it where the rule against overstretch is off.
    pub(in crate::cell) fn enforce_tissue_limits(&mut self, least: f64, log: &mut PeriodLog) -> Vec<TissueAtArm> {
        let (rules, none) = (self.rules, vec![TissueAtArm::default(); self.arms.len()]);
        if !(rules.pierce || rules.overstretch || rules.relax) {
            return none;
        }
        let waiting = self.waits.iter().any(|w| *w > 0);
        if least > SQUEEZED && !waiting && !self.arms.iter().any(ArmUnit::meets_tissue) {
            return none;
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
        if !rules.overstretch {
            return none;
        }
        self.arms.iter().map(|arm| TissueAtArm::of(&self.world, arm, &strains)).collect()
    }
}
