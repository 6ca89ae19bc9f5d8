//! Applies the rules on tissue after a frame.

use super::scope::Scope;
use super::strain::SQUEEZED;
use super::{overstretch, pierce, reconnect, relax};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;

impl Cell {
    /// Applies the rules on tissue after a frame whose smallest element has the share `least` of
    /// its rest volume. Returns for each arm the share of the force guard's limit that the strain of
    /// the tissue at it has.
    pub(in crate::cell) fn enforce_tissue_limits(&mut self, least: f64, log: &mut PeriodLog) -> Vec<f64> {
        let (rules, none) = (self.rules, vec![0.0; self.arms.len()]);
        if !(rules.force_guard || rules.pierce || rules.overstretch || rules.relax) {
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
        let at = |arm: &ArmUnit| {
            let organs = strains.iter().enumerate().filter(|(organ, s)| overstretch::is_at(arm, s.at, *organ));
            organs.map(|(_, s)| s.guarded()).fold(0.0, f64::max)
        };
        self.arms.iter().map(at).collect()
    }
}
