//! Fig. 7(f): do elements invert, and does anything diverge, when a cluster of the appendix is carried high
//! against what holds the rest? Measured in the whole cell and with the appendix alone.

use super::lift_trials::{
    AppendixSource, Condition, LiftTrial, appendix, design_name, divergence, peak_constraint, pin_end_and_band,
};
use super::trials::{Outcomes, Resumed, Trials};
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_scene::{GraspDesignName, Scene};
use trocar_specimen::Specimen;
use trocar_task::policy::{AfterHold, Script};
use trocar_workflow::REPORT;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "element-quality.json";

/// Jaw lifts (m).
const LIFTS: [f64; 2] = [0.015, 0.030];

/// Young's moduli (Pa).
const MODULI: [f64; 5] = [3e3, 6e3, 12e3, 24e3, 48e3];

/// Pin rules, and the share of the lowest nodes along the whole organ that each pins besides the far end.
const PINS: [(&str, f64); 2] = [("far-end", 0.0), ("far-end + band", 0.42)];

/// Designs.
const DESIGNS: [GraspDesignName; 2] = [GraspDesignName::LivePose, GraspDesignName::Compliant];

/// Organ coordinate of the grasp.
const AT: f64 = 0.5;

/// Scaled forces are the given one at this modulus (Pa).
const FORCE_AT: f64 = 12e3;

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct ElementQualityExperiment {
    /// The appendix.
    pub appendix: AppendixSource,
    /// In what it is lifted.
    pub conditions: Vec<Condition>,
    /// Force of the jaws (N), the same for all moduli.
    pub jaw_force: f64,
    /// Run all cases a second time with a jaw force in proportion to the modulus, so that tissue of every
    /// modulus is squeezed alike.
    pub scaled: bool,
    /// Trials at once; 0 for as many as the machine has threads.
    pub threads: usize,
}

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementQualityRow {
    /// In what the appendix was lifted.
    pub condition: Condition,
    /// The jaw force is in proportion to the modulus.
    pub scaled: bool,
    /// The grasp design's name.
    pub design: String,
    /// Jaw lift (mm).
    pub lift_mm: f64,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// The pin rule.
    pub pins: String,
    /// Force of the jaws (N).
    pub jaw_force_n: f64,
    /// The jaws took hold of the appendix.
    pub attached: bool,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// It diverged.
    pub diverged: bool,
    /// Why.
    pub divergence: Option<String>,
    /// Why it did not pass, in one line.
    pub why: Option<String>,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Smallest volume of an element over its volume at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip (mm).
    pub slip_mm: f64,
    /// Largest motion of any node in the first frame of the grasp (mm): what moved.
    pub activation_step_mm: f64,
    /// Largest pull of held nodes at the gripper (N).
    pub peak_constraint_n: f64,
    /// Times that held tissue began to slide.
    pub slipped: usize,
    /// The tissue tore out.
    pub torn: bool,
    /// Suspensions of physics: contacts disabled, contacts of blades disabled, organs relaxed.
    pub suspensions: [usize; 3],
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ElementQualityResult {
    /// Every case.
    pub rows: Vec<ElementQualityRow>,
    /// Force of the jaws (N); of scaled cases at 12 kPa.
    pub jaw_force_n: f64,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Its elements.
    pub tets: usize,
    /// What an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time of everything (s).
    pub seconds: f64,
    /// The page's path.
    pub report: String,
}

/// A case to be run.
struct Case {
    pins: &'static str,
    modulus: f64,
    scaled: bool,
    scene: Scene,
    /// Place of the specimen among those of the conditions.
    specimen: usize,
    trial: LiftTrial,
}

impl ElementQualityExperiment {
    /// Runs everything into the folder `output`: the phantom's recording and specimen, the figures and the
    /// page. Cases that an earlier run in the folder finished are not run again.
    ///
    /// # Errors
    /// A specimen without an appendix, an option out of range, a folder that cannot be written, an
    /// interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ElementQualityResult> {
        let clock = Instant::now();
        super::claim(output, MARKER)?;
        let whole = self.appendix.read(output, progress)?;
        let mut cases = Vec::new();
        let specimens: Vec<Specimen> = self.conditions.iter().map(|c| whole.specimen(*c)).collect();
        for (k, condition) in self.conditions.iter().enumerate() {
            cases.extend(self.cases(*condition, k, &whole.scene(*condition)?, &specimens[k]));
        }
        let settings = format!("{} N, {}", self.jaw_force, whole.fingerprint());
        let store = Trials::open(output, "element-quality", &settings)?;
        let one = |case: &Case, progress: &dyn Progress| case.run(&specimens[case.specimen], progress);
        let Outcomes { rows, resumed } = store.run("cases", &cases, Case::key, self.threads, progress, one)?;
        let (nodes, tets) = whole.size();
        let result = ElementQualityResult {
            rows,
            jaw_force_n: self.jaw_force,
            nodes,
            tets,
            resumed,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::element_quality(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    fn cases(&self, condition: Condition, place: usize, scene: &Scene, specimen: &Specimen) -> Vec<Case> {
        let mut cases = Vec::new();
        let runs: &[bool] = if self.scaled { &[false, true] } else { &[false] };
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
                        Case { pins, modulus, scaled, scene, specimen: place, trial }
                    }));
                }
            }
        }
        cases
    }
}

impl Case {
    /// Its name among all.
    fn key(&self) -> String {
        let (condition, design) = (self.trial.condition.name(), design_name(self.trial.design));
        let (lift, force) = (self.trial.script.lift, if self.scaled { "scaled" } else { "one force" });
        format!("{condition}, {design} {lift} m, {}, {} Pa, {force}", self.pins, self.modulus)
    }

    fn run(&self, specimen: &Specimen, progress: &dyn Progress) -> Result<ElementQualityRow> {
        let made = self.trial.run(&self.scene, specimen, progress)?;
        let (s, d) = (&made.summary, &made.summary.details);
        Ok(ElementQualityRow {
            condition: self.trial.condition,
            scaled: self.scaled,
            design: design_name(self.trial.design).to_owned(),
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
            peak_constraint_n: peak_constraint(&made),
            slipped: d.slipped,
            torn: s.torn > 0,
            suspensions: [s.disabled_contacts, s.disabled_blades, s.relaxed],
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A made-up result.
    pub(crate) fn made_up_result() -> ElementQualityResult {
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
                    follow_ratio: 0.99,
                    slip_mm: 0.1,
                    activation_step_mm: 0.01,
                    peak_constraint_n: 0.4,
                    slipped: 0,
                    torn: false,
                    suspensions: [0, 0, 0],
                }));
            }
        }
        ElementQualityResult {
            rows,
            jaw_force_n: 1.0,
            nodes: 1,
            tets: 1,
            resumed: Resumed::default(),
            seconds: 1.0,
            report: String::new(),
        }
    }
}
