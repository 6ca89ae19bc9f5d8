//! Table II and Fig. 7(a) to (c): four ways to hold the appendix, at five places and from three sides, and once more after it was dragged.

use super::appendix::{AppendixSource, fingerprint, with_organ};
use super::trials::{Outcomes, Resumed, Trials};
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use trocar_cell::{GraspDesign, GraspLift, GraspLiftRun, World, clusters};
use trocar_core::Progress;
use trocar_specimen::{Material, Specimen};
use trocar_tissue::SolverSettings;
use trocar_workflow::REPORT;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "grasp-designs.json";

/// Grip locations.
const LOCATIONS: usize = 5;

/// How far beside the appendix's middle the gripper comes [m].
const OFFSETS: [f64; 3] = [-0.002, 0.0, 0.002];

/// How far the appendix is dragged before it is grasped again [m].
const DRAGS: [f64; 2] = [0.005, 0.010];

/// Designs that grasp again.
const REGRASPS: [GraspDesign; 3] = [GraspDesign::RestPose, GraspDesign::LivePose, GraspDesign::Compliant];

/// A row of the paper's Table II.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperGrasp {
    /// Trials held.
    pub held: usize,
    /// Trials.
    pub trials: usize,
    /// Trials that diverged.
    pub diverged: usize,
    /// Lift [mm], median.
    pub lift_mm: f64,
    /// Slip [mm], median.
    pub slip_mm: f64,
    /// Snap [mm], least and greatest; none for friction.
    pub snap_mm: Option<(f64, f64)>,
}

/// The paper's row for a design, again or not.
fn paper(design: GraspDesign, regrasp: bool) -> Option<PaperGrasp> {
    let row = |held, trials, diverged, lift_mm, slip_mm, snap_mm| PaperGrasp {
        held,
        trials,
        diverged,
        lift_mm,
        slip_mm,
        snap_mm,
    };
    match (design, regrasp) {
        (GraspDesign::Friction, false) => Some(row(0, 15, 0, 4.9, 10.1, None)),
        (GraspDesign::RestPose, false) => Some(row(13, 15, 1, 15.1, 0.45, Some((4.7, 4.7)))),
        (GraspDesign::LivePose, false) => Some(row(13, 15, 2, 15.2, 0.32, Some((0.0, 0.0)))),
        (GraspDesign::RestPose, true) => Some(row(5, 5, 0, 15.4, 0.48, Some((4.3, 17.8)))),
        (GraspDesign::LivePose, true) => Some(row(5, 5, 0, 15.2, 0.37, Some((0.0, 0.0)))),
        _ => None,
    }
}

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct GraspDesignsExperiment {
    /// The appendix.
    pub appendix: AppendixSource,
    /// Jaw lift [m].
    pub lift: f64,
    /// Force of the jaws [N].
    pub jaw_force: f64,
    /// Trials at once; 0 for as many as the machine has threads.
    pub threads: usize,
}

/// One trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspTrial {
    /// The design's name.
    pub design: String,
    /// Organ coordinate asked for.
    pub asked: f64,
    /// Organ coordinate of the grasped cluster.
    pub at: f64,
    /// How far beside the appendix the gripper came [mm].
    pub offset_mm: f64,
    /// How far it was dragged before [mm].
    pub drag_mm: Option<f64>,
    /// Tissue was between the blades.
    pub attached: bool,
    /// Follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// What ended it, if it diverged.
    pub divergence: Option<String>,
    /// Lift [mm].
    pub lift_mm: f64,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip [mm].
    pub slip_mm: f64,
    /// Greatest snap over the nodes [mm]; none for friction.
    pub snap_mm: Option<f64>,
    /// Mean snap over the nodes [mm].
    pub snap_mean_mm: Option<f64>,
    /// Mean distance of the nodes from their places at rest when the jaws had closed [mm].
    pub displaced_mm: f64,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// Smallest volume of an element over its volume at rest.
    pub min_volume_ratio: f64,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Force with which tissue pushed the blades apart when they had closed [N].
    pub closing_force_n: f64,
    /// Gap between the blades then [mm].
    pub gap_mm: f64,
    /// Largest pull of held nodes at the gripper [N].
    pub peak_constraint_n: f64,
    /// Frames in which held tissue began to slide.
    pub slipped: usize,
    /// The tissue tore out.
    pub torn: bool,
    /// Time since the lift began [s], lift of jaw and tissue [mm].
    pub lifts: Vec<(f64, f64, f64)>,
}

/// One row of Table II.
#[derive(Clone, Debug, Serialize)]
pub struct GraspDesignRow {
    /// The design's name; "re-grasp, " before it for the second grasp of dragged tissue.
    pub design: String,
    /// Trials held.
    pub held: usize,
    /// Trials.
    pub trials: usize,
    /// Trials that diverged.
    pub diverged: usize,
    /// Mean lift of the others [mm].
    pub lift_mm: f64,
    /// Their mean slip [mm].
    pub slip_mm: f64,
    /// Greatest snap [mm]; none for friction.
    pub snap_mm: Option<f64>,
    /// Least snap of a trial [mm].
    pub snap_least_mm: Option<f64>,
    /// Mean follow ratio.
    pub follow_ratio: f64,
    /// Most inverted elements in any frame of any trial.
    pub inverted_peak: usize,
    /// Median lift [mm], which is what the paper gives.
    pub lift_median_mm: f64,
    /// Median slip [mm].
    pub slip_median_mm: f64,
    /// Greatest slip [mm].
    pub slip_most_mm: f64,
    /// Smallest volume of an element over its volume at rest in any trial.
    pub min_volume_ratio: f64,
    /// The paper's row.
    pub paper: Option<PaperGrasp>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct GraspDesignsResult {
    /// A row a design.
    pub rows: Vec<GraspDesignRow>,
    /// Every trial.
    pub trials: Vec<GraspTrial>,
    /// Jaw lift [mm].
    pub lift_mm: f64,
    /// Force of the jaws [N].
    pub jaw_force_n: f64,
    /// Young's modulus [kPa].
    pub modulus_kpa: f64,
    /// Density [kg/m3].
    pub density_kg_m3: f64,
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

impl GraspDesignsExperiment {
    /// Runs everything into the folder `output`: the phantom's recording and specimen, the figures and the report. Trials that an earlier run in the folder finished are not run again.
    ///
    /// # Errors
    /// A specimen without an appendix, an option out of range, a folder that cannot be written, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<GraspDesignsResult> {
        let clock = Instant::now();
        super::claim(output, MARKER)?;
        let specimen = self.appendix.appendix(output, progress)?;
        // The paper's: 12 kPa, 1200 kg/m3.
        let material = Material { model: specimen.organs[0].material.model, ..Material::default() };
        let specimen = with_organ(&specimen, |organ| organ.material = material);
        let tasks = self.tasks(&locations(&specimen)?);
        let settings = format!("{} N, {} m, {}", self.jaw_force, self.lift, fingerprint(&specimen));
        let store = Trials::open(output, "grasp-designs", &settings)?;
        let one = |task: &GraspLift, progress: &dyn Progress| -> Result<GraspTrial> {
            Ok(trial(task, &task.run(&specimen, progress)?))
        };
        let Outcomes { rows: trials, resumed } = store.run("trials", &tasks, key, self.threads, progress, one)?;
        let result = GraspDesignsResult {
            rows: rows(&trials),
            trials,
            lift_mm: 1e3 * self.lift,
            jaw_force_n: self.jaw_force,
            modulus_kpa: 1e-3 * material.young_modulus_pa,
            density_kg_m3: material.density_kg_m3,
            nodes: specimen.organs[0].body.vertices.len(),
            tets: specimen.organs[0].body.tets.len(),
            resumed,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::grasp_designs(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    fn tasks(&self, locations: &[f64]) -> Vec<GraspLift> {
        let task = |design, at, approach_offset, regrasp| GraspLift {
            at,
            lift: self.lift,
            design,
            jaw_force: self.jaw_force,
            approach_offset,
            regrasp,
            lower: false,
            threads: 1,
            ..GraspLift::default()
        };
        let mut tasks = Vec::new();
        for design in GraspDesign::ALL {
            tasks.extend(locations.iter().flat_map(|at| OFFSETS.map(|offset| task(design, *at, offset, None))));
        }
        for design in REGRASPS {
            tasks.extend(locations.iter().flat_map(|at| DRAGS.map(|drag| task(design, *at, 0.0, Some(drag)))));
        }
        tasks
    }
}

/// Grip locations: evenly over the part of the organ that can be grasped and lifted.
fn locations(specimen: &Specimen) -> Result<Vec<f64>> {
    let world = World::new(specimen, SolverSettings::default(), 1)?;
    let all = clusters(&world, 0);
    let clear: Vec<f64> = all.iter().filter(|c| c.clear).map(|c| c.s).collect();
    let (Some(first), Some(last)) = (clear.first(), clear.last()) else {
        return Err(Error::Mismatch("no part of the appendix is clear of pins; pin less of it".to_owned()));
    };
    Ok((0..LOCATIONS).map(|k| first + (last - first) * k as f64 / (LOCATIONS - 1) as f64).collect())
}

/// A trial's name among all.
fn key(task: &GraspLift) -> String {
    format!("{} at {}, offset {} m, drag {:?} m", task.design, task.at, task.approach_offset, task.regrasp)
}

fn trial(task: &GraspLift, run: &GraspLiftRun) -> GraspTrial {
    let s = &run.summary;
    let ties = task.design != GraspDesign::Friction;
    let lifted = || run.samples.iter().filter(|s| s.phase == "lift" || s.phase == "hold");
    let start = lifted().next().map_or(0.0, |s| s.time_s);
    GraspTrial {
        design: task.design.name().to_owned(),
        asked: task.at,
        at: s.at,
        offset_mm: s.approach_offset_mm,
        drag_mm: task.regrasp.map(|d| 1e3 * d),
        attached: s.attached,
        held: s.held,
        divergence: s.divergence.clone(),
        lift_mm: s.lift_mm,
        follow_ratio: s.follow_ratio,
        slip_mm: s.slip_mm,
        snap_mm: ties.then_some(s.snap_mm),
        snap_mean_mm: ties.then_some(s.snap_mean_mm),
        displaced_mm: s.displaced_mm,
        inverted_peak: s.inverted_peak,
        min_volume_ratio: s.min_volume_ratio,
        yielded_substeps: s.yielded_substeps,
        closing_force_n: s.closing_force_n,
        gap_mm: s.gap_mm,
        peak_constraint_n: s.peak_constraint_n,
        slipped: s.slipped,
        torn: s.torn,
        lifts: lifted().map(|s| (s.time_s - start, s.jaw_lift_mm, s.tissue_lift_mm)).collect(),
    }
}

/// A row a design, those of the second grasp last.
fn rows(trials: &[GraspTrial]) -> Vec<GraspDesignRow> {
    let first = GraspDesign::ALL.iter().map(|d| (*d, false));
    let again = REGRASPS.iter().map(|d| (*d, true));
    first.chain(again).filter_map(|(design, regrasp)| row(design, regrasp, trials)).collect()
}

fn row(design: GraspDesign, regrasp: bool, trials: &[GraspTrial]) -> Option<GraspDesignRow> {
    let of: Vec<&GraspTrial> =
        trials.iter().filter(|t| t.design == design.name() && t.drag_mm.is_some() == regrasp).collect();
    let ended: Vec<&&GraspTrial> = of.iter().filter(|t| t.divergence.is_none()).collect();
    let values = |value: &dyn Fn(&GraspTrial) -> f64| -> Vec<f64> { ended.iter().map(|t| value(t)).collect() };
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let median = |mut values: Vec<f64>| crate::bench::median(&mut values);
    let snaps = || of.iter().filter_map(|t| t.snap_mm);
    (!of.is_empty()).then(|| GraspDesignRow {
        design: format!("{}{design}", if regrasp { "re-grasp, " } else { "" }),
        held: of.iter().filter(|t| t.held).count(),
        trials: of.len(),
        diverged: of.len() - ended.len(),
        lift_mm: mean(values(&|t| t.lift_mm)),
        slip_mm: mean(values(&|t| t.slip_mm)),
        snap_mm: snaps().reduce(f64::max),
        snap_least_mm: snaps().reduce(f64::min),
        follow_ratio: mean(values(&|t| t.follow_ratio)),
        inverted_peak: of.iter().map(|t| t.inverted_peak).max().unwrap_or(0),
        lift_median_mm: median(values(&|t| t.lift_mm)),
        slip_median_mm: median(values(&|t| t.slip_mm)),
        slip_most_mm: values(&|t| t.slip_mm).into_iter().fold(0.0, f64::max),
        min_volume_ratio: of.iter().map(|t| t.min_volume_ratio).fold(1.0, f64::min),
        paper: paper(design, regrasp),
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A made-up trial whose figures go with `k`.
    fn made_up(design: GraspDesign, k: usize, drag_mm: Option<f64>) -> GraspTrial {
        let value = k as f64;
        let ties = design != GraspDesign::Friction;
        GraspTrial {
            design: design.name().to_owned(),
            asked: 0.5 + 0.1 * (k / 3) as f64,
            at: 0.5 + 0.1 * (k / 3) as f64,
            offset_mm: 2.0 * (k % 3) as f64 - 2.0,
            drag_mm,
            attached: true,
            held: k != 1,
            divergence: (k == 1).then(|| "<b>made up</b>".to_owned()),
            lift_mm: 15.0 - value,
            follow_ratio: 1.0,
            slip_mm: 0.1 * value,
            snap_mm: ties.then_some(value),
            snap_mean_mm: ties.then_some(0.5 * value),
            displaced_mm: 0.6 * value,
            inverted_peak: k,
            min_volume_ratio: 0.5,
            yielded_substeps: 0,
            closing_force_n: 1.0,
            gap_mm: 4.0,
            peak_constraint_n: 0.2,
            slipped: 0,
            torn: false,
            lifts: vec![(0.0, 0.0, 0.0), (1.0, 15.0, 15.0 - value)],
        }
    }

    /// A made-up result of every design.
    pub(crate) fn made_up_result() -> GraspDesignsResult {
        let mut trials = Vec::new();
        for design in GraspDesign::ALL {
            trials.extend((0..15).map(|k| made_up(design, k, None)));
        }
        for design in REGRASPS {
            trials.extend((0..10).map(|k| made_up(design, k, Some(5.0))));
        }
        GraspDesignsResult {
            rows: rows(&trials),
            trials,
            lift_mm: 15.0,
            jaw_force_n: 1.0,
            modulus_kpa: 12.0,
            density_kg_m3: 1200.0,
            nodes: 1,
            tets: 1,
            resumed: Resumed::default(),
            seconds: 1.0,
            report: String::new(),
        }
    }

    #[test]
    fn rows_sum_up_their_trials() {
        let rows = made_up_result().rows;
        let names: Vec<&str> = rows.iter().map(|r| r.design.as_str()).collect();
        let again = ["re-grasp, rest-pose", "re-grasp, live-pose", "re-grasp, compliant"];
        assert_eq!(names[..4], ["friction", "rest-pose", "live-pose", "compliant"]);
        assert_eq!(names[4..], again);
        let live = &rows[2];
        assert_eq!((live.held, live.trials, live.diverged, live.inverted_peak), (14, 15, 1, 14));
        // The mean of 0 to 14 without 1.
        assert!((live.lift_mm - (15.0 - 104.0 / 14.0)).abs() < 1e-12, "a diverged trial has no lift");
        assert_eq!((live.snap_mm, live.snap_least_mm), (Some(14.0), Some(0.0)));
        assert_eq!(live.paper.map(|p| (p.held, p.diverged)), Some((13, 2)));
        assert_eq!((rows[0].snap_mm, rows[3].paper), (None, None));
        assert_eq!(rows[4].paper.and_then(|p| p.snap_mm), Some((4.3, 17.8)));
    }
}
