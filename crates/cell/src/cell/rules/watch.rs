//! Stage 6: looks at the tissue after a frame, warns, and informs the force guard.

use super::organ_watch::OrganWatch;
use super::strain::SQUEEZED;
use super::tissue_at_arm::TissueAtArm;
use super::{fold, overstretch, pierce};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;

impl Cell {
    /// Looks for instruments in organs and for tissue that is strained too much, after a frame
    /// whose smallest element has the share `least` of its rest volume. Returns the strain of the
    /// tissue at each arm, or none of it where the scene has no strain guard.
    pub(in crate::cell) fn watch_tissue(&mut self, least: f64, log: &mut PeriodLog) -> Vec<TissueAtArm> {
        pierce::warn(&self.world, &mut self.arms, log);
        let none = vec![TissueAtArm::default(); self.arms.len()];
        let strained = self.watches.iter().any(|watch| *watch != OrganWatch::default());
        if least > SQUEEZED && !strained && !self.arms.iter().any(ArmUnit::meets_tissue) {
            return none;
        }
        let strains = self.edges.strains(&self.world, least);
        self.watches.resize(strains.len(), OrganWatch::default());
        for (organ, strain) in strains.iter().enumerate() {
            let (name, watch) = (self.world.model.bodies()[organ].name(), &mut self.watches[organ]);
            let arm = overstretch::instrument_at(&self.world, &self.arms, strain, organ);
            overstretch::warn(arm, strain, name, watch, log);
            fold::warn(arm, strain, name, watch, log);
        }
        if !self.strain_guard {
            return none;
        }
        self.arms.iter().map(|arm| TissueAtArm::of(&self.world, arm, &strains)).collect()
    }
}
