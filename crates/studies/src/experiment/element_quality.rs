//! Fig. 7(f): do elements invert, and does anything diverge, when a cluster of the appendix is carried high against what holds the rest?

use super::appendix::{AppendixSource, fingerprint, with_organ};
use super::trials::{Outcomes, Resumed, Trials};
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use trocar_cell::{GraspDesign, GraspLift};
use trocar_core::Progress;
use trocar_specimen::{Organ, Pins, Specimen};
use trocar_workflow::REPORT;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "element-quality.json";

/// Jaw lifts [m].
const LIFTS: [f64; 2] = [0.015, 0.030];

/// Young's moduli [Pa].
const MODULI: [f64; 5] = [3e3, 6e3, 12e3, 24e3, 48e3];

/// Pin rules, and the share of the lowest nodes along the whole organ that each pins besides the far end.
const PINS: [(&str, f64); 2] = [("far-end", 0.0), ("far-end + band", 0.42)];

/// Designs.
const DESIGNS: [GraspDesign; 2] = [GraspDesign::LivePose, GraspDesign::Compliant];

/// Organ coordinate of the grasp.
const AT: f64 = 0.5;

/// The jaws press with the given force at this modulus [Pa], and with more or less in proportion at others, so that tissue of every modulus is squeezed alike.
const FORCE_AT: f64 = 12e3;

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct ElementQualityExperiment {
    /// The appendix.
    pub appendix: AppendixSource,
    /// Force of the jaws at 12 kPa [N]; at other moduli in proportion.
    pub jaw_force: f64,
    /// Trials at once; 0 for as many as the machine has threads.
    pub threads: usize,
}

/// One case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ElementQualityRow {
    /// The grasp design's name.
    pub design: String,
    /// Jaw lift [mm].
    pub lift_mm: f64,
    /// Young's modulus [kPa].
    pub modulus_kpa: f64,
    /// The pin rule.
    pub pins: String,
    /// Force of the jaws [N].
    pub jaw_force_n: f64,
    /// Tissue was between the blades.
    pub attached: bool,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// It diverged.
    pub diverged: bool,
    /// Why.
    pub divergence: Option<String>,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Smallest volume of an element over its volume at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip [mm].
    pub slip_mm: f64,
    /// Largest pull of held nodes at the gripper [N].
    pub peak_constraint_n: f64,
    /// Frames in which held tissue began to slide.
    pub slipped: usize,
    /// The tissue tore out.
    pub torn: bool,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ElementQualityResult {
    /// Every case.
    pub rows: Vec<ElementQualityRow>,
    /// Force of the jaws at 12 kPa [N].
    pub jaw_force_n: f64,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Its elements.
    pub tets: usize,
    /// What an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// A case to be run.
struct Case {
    pins: &'static str,
    modulus: f64,
    specimen: Specimen,
    task: GraspLift,
}

impl ElementQualityExperiment {
    /// Runs everything into the folder `output`: the phantom's recording and specimen, the figures and the report. Cases that an earlier run in the folder finished are not run again.
    ///
    /// # Errors
    /// A specimen without an appendix, an option out of range, a folder that cannot be written, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ElementQualityResult> {
        let clock = Instant::now();
        super::claim(output, MARKER)?;
        let specimen = self.appendix.appendix(output, progress)?;
        let cases = self.cases(&specimen);
        let settings = format!("{} N, {}", self.jaw_force, fingerprint(&specimen));
        let store = Trials::open(output, "element-quality", &settings)?;
        let one = |case: &Case, progress: &dyn Progress| case.run(progress);
        let Outcomes { rows, resumed } = store.run("cases", &cases, Case::key, self.threads, progress, one)?;
        let result = ElementQualityResult {
            rows,
            jaw_force_n: self.jaw_force,
            nodes: specimen.organs[0].body.vertices.len(),
            tets: specimen.organs[0].body.tets.len(),
            resumed,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::element_quality(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    fn cases(&self, specimen: &Specimen) -> Vec<Case> {
        let mut cases = Vec::new();
        for design in DESIGNS {
            for (pins, share) in PINS {
                for lift in LIFTS {
                    cases.extend(MODULI.map(|modulus| {
                        let jaw_force = self.jaw_force * modulus / FORCE_AT;
                        let common = GraspLift::default();
                        let task = GraspLift { at: AT, lift, design, jaw_force, lower: false, threads: 1, ..common };
                        let specimen = with_organ(specimen, |organ| {
                            organ.material.young_modulus_pa = modulus;
                            pin(organ, share);
                        });
                        Case { pins, modulus, specimen, task }
                    }));
                }
            }
        }
        cases
    }
}

/// Pins the far end as the specimen has it, and the lowest `share` of the nodes of all the rest; an organ that is not pinned at an end stays as it is.
fn pin(organ: &mut Organ, share: f64) {
    if let Pins::End { length, band_length, band_share, .. } = &mut organ.pins {
        *band_length = if share > 0.0 { 1.0 - *length } else { 0.0 };
        *band_share = share;
    }
}

impl Case {
    /// Its name among all.
    fn key(&self) -> String {
        format!("{} {} m, {}, {} Pa", self.task.design, self.task.lift, self.pins, self.modulus)
    }

    fn run(&self, progress: &dyn Progress) -> Result<ElementQualityRow> {
        let s = self.task.run(&self.specimen, progress)?.summary;
        Ok(ElementQualityRow {
            design: self.task.design.name().to_owned(),
            lift_mm: 1e3 * self.task.lift,
            modulus_kpa: 1e-3 * self.modulus,
            pins: self.pins.to_owned(),
            jaw_force_n: self.task.jaw_force,
            attached: s.attached,
            inverted_peak: s.inverted_peak,
            diverged: s.diverged,
            divergence: s.divergence,
            yielded_substeps: s.yielded_substeps,
            min_volume_ratio: s.min_volume_ratio,
            held: s.held,
            follow_ratio: s.follow_ratio,
            slip_mm: s.slip_mm,
            peak_constraint_n: s.peak_constraint_n,
            slipped: s.slipped,
            torn: s.torn,
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
                    design: design.name().to_owned(),
                    lift_mm: 1e3 * lift,
                    modulus_kpa: 1e-3 * modulus,
                    pins: pins.to_owned(),
                    jaw_force_n: 1.0,
                    attached: true,
                    inverted_peak: usize::from(modulus < 4e3),
                    diverged: false,
                    divergence: None,
                    yielded_substeps: 3,
                    min_volume_ratio: 0.3,
                    held: true,
                    follow_ratio: 0.99,
                    slip_mm: 0.1,
                    peak_constraint_n: 0.4,
                    slipped: 0,
                    torn: false,
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
