//! Fig. 7(f): whether elements invert or lifts diverge when a cluster of the appendix is lifted
//! high against its pins. Measured in the whole cell and with the appendix alone.

mod page;
mod result;

use super::appendix::{
    Condition, ConditionName, FOLDER, LiftTrial, Whole, appendix, divergence, peak_constraint, pin_end_and_band,
};
use crate::Result;
use crate::names::AppendixChoice;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use clap::Args;
use result::{ElementQualityResult, ElementQualityRow};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_scene::{GraspDesignName, Scene};
use trocar_specimen::Specimen;
use trocar_task::policy::{AfterHold, Script};

/// Jaw lifts (m).
const LIFTS: [f64; 2] = [0.015, 0.030];

/// Young's moduli (Pa).
const MODULI: [f64; 5] = [3e3, 6e3, 12e3, 24e3, 48e3];

/// Pin rules: name, and the share of the lowest nodes of the rest of the organ that is also pinned.
const PINS: [(&str, f64); 2] = [("far-end", 0.0), ("far-end + band", 0.42)];

const DESIGNS: [GraspDesignName; 2] = [GraspDesignName::LivePose, GraspDesignName::Compliant];

/// Organ coordinate of the grasp.
const AT: f64 = 0.5;

/// Modulus at which a scaled force equals the given force (Pa).
const FORCE_AT: f64 = 12e3;

/// Fig. 7(f): whether elements invert when the appendix is lifted by 15 and 30 mm, at five moduli
/// and with two pin rules.
#[derive(Clone, Debug, Args)]
pub struct ElementQualityExperiment {
    /// The appendix.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// Lift in the whole cell, the appendix alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Closing force of the jaws (N), the same for all moduli.
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Also run all cases with a jaw force proportional to the modulus (--jaw-force at 12 kPa):
    /// tissue of every modulus is squeezed alike.
    #[arg(long)]
    pub scaled_force: bool,
    /// Cases in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

struct Case<'a> {
    pins: &'static str,
    modulus: f64,
    scaled: bool,
    scene: Scene,
    specimen: &'a Specimen,
    trial: LiftTrial,
}

impl Study for ElementQualityExperiment {
    const NAME: &'static str = "element-quality";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(FOLDER);
    const SCHEMA: u32 = 3;
    type Figures = ElementQualityResult;

    fn run(&self, job: &Job<'_>) -> Result<(ElementQualityResult, Document)> {
        job.claim()?;
        let whole = Whole::read(&self.appendix, job.output(), job.progress)?;
        let conditions = self.condition.conditions();
        let specimens: Vec<Specimen> = conditions.iter().map(|c| whole.specimen(*c)).collect();
        let mut cases = Vec::new();
        for (condition, specimen) in conditions.iter().zip(&specimens) {
            cases.extend(self.cases(*condition, &whole.scene(*condition)?, specimen));
        }
        let settings = format!("{} N, {}", self.jaw_force, whole.fingerprint());
        let Outcomes { rows, resumed } = job.trials("cases", &settings, &cases, Case::key, self.threads, Case::run)?;
        let (nodes, tets) = whole.size();
        let result = ElementQualityResult { rows, jaw_force_n: self.jaw_force, nodes, tets, resumed };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl ElementQualityExperiment {
    fn cases<'a>(&self, condition: Condition, scene: &Scene, specimen: &'a Specimen) -> Vec<Case<'a>> {
        let mut cases = Vec::new();
        let runs: &[bool] = if self.scaled_force { &[false, true] } else { &[false] };
        for (scaled, design) in runs.iter().flat_map(|s| DESIGNS.map(|d| (*s, d))) {
            for (pins, share) in PINS {
                for lift in LIFTS {
                    cases.extend(MODULI.map(|modulus| {
                        let mut scene = scene.clone();
                        appendix(&mut scene).material.young_modulus_pa = Some(modulus);
                        pin_end_and_band(&mut scene, specimen, share);
                        let jaw_force = self.jaw_force * if scaled { modulus / FORCE_AT } else { 1.0 };
                        let script = Script { at: AT, lift, after: AfterHold::Finish, ..Script::default() };
                        let trial = LiftTrial { condition, script, design, jaw_force };
                        Case { pins, modulus, scaled, scene, specimen, trial }
                    }));
                }
            }
        }
        cases
    }
}

impl Case<'_> {
    /// The unique name of the case.
    fn key(&self) -> String {
        let (condition, design) = (self.trial.condition.name(), self.trial.design_name());
        let (lift, force) = (self.trial.script.lift, if self.scaled { "scaled" } else { "one force" });
        format!("{condition}, {design} {lift} m, {}, {} Pa, {force}", self.pins, self.modulus)
    }

    fn run(&self, progress: &dyn Progress) -> Result<ElementQualityRow> {
        let made = self.trial.run(&self.scene, self.specimen, progress)?;
        let (s, d) = (&made.summary, &made.summary.details);
        Ok(ElementQualityRow {
            condition: self.trial.condition,
            scaled: self.scaled,
            design: self.trial.design_name(),
            lift_mm: 1e3 * self.trial.script.lift,
            modulus_kpa: 1e-3 * self.modulus,
            pins: self.pins.to_owned(),
            jaw_force_n: self.trial.jaw_force,
            attached: s.attached,
            inverted_peak: s.inverted_peak,
            diverged: s.diverged,
            divergence: divergence(&made),
            why: s.why.clone(),
            yielded_substeps: s.yielded_substeps,
            min_volume_ratio: s.min_volume_ratio,
            held: s.held,
            follow_ratio: s.follow_ratio,
            slip_mm: s.slip_mm,
            activation_step_mm: d.activation_step_mm,
            peak_constraint_n: s.attached.then(|| peak_constraint(&made)),
            slipped: d.slipped,
            torn: s.torn > 0,
            warnings: s.warnings,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::names::design_name;
    use crate::trials::Resumed;
    use trocar_task::Warnings;

    fn made_up_result() -> ElementQualityResult {
        let mut rows = Vec::new();
        for (pins, _) in PINS {
            for (design, modulus) in DESIGNS.iter().flat_map(|d| MODULI.map(|m| (*d, m))) {
                rows.extend(LIFTS.map(|lift| ElementQualityRow {
                    condition: Condition::Appendix,
                    scaled: false,
                    design: design_name(design).to_owned(),
                    lift_mm: 1e3 * lift,
                    modulus_kpa: 1e-3 * modulus,
                    pins: pins.to_owned(),
                    jaw_force_n: 1.0,
                    attached: true,
                    inverted_peak: usize::from(modulus < 4e3),
                    diverged: false,
                    divergence: None,
                    why: None,
                    yielded_substeps: 3,
                    min_volume_ratio: 0.3,
                    held: true,
                    follow_ratio: Some(0.99),
                    slip_mm: Some(0.1),
                    activation_step_mm: Some(0.01),
                    peak_constraint_n: Some(0.4),
                    slipped: 0,
                    torn: false,
                    warnings: Warnings::default(),
                }));
            }
        }
        ElementQualityResult { rows, jaw_force_n: 1.0, nodes: 1, tets: 1, resumed: Resumed::default() }
    }

    #[test]
    fn the_page_shows_every_case() {
        let result = made_up_result();
        let html = page::document(&result).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 2);
        assert_eq!(html.matches("<tr>").count(), result.rows.len() + 1);
        assert!(html.contains("far-end + band pinned") && html.contains("card bad"), "one case inverts");
    }
}
