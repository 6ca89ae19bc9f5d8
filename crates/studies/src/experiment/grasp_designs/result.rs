//! The figures of the grasp designs: trials, rows of Table II, and the paper's.

use crate::experiment::appendix::Condition;
use crate::names::design_name;
use crate::statistics::median;
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_scene::GraspDesignName;
use trocar_task::Warnings;

/// All designs, in the paper's order.
pub(super) const DESIGNS: [GraspDesignName; 4] =
    [GraspDesignName::Friction, GraspDesignName::RestPose, GraspDesignName::LivePose, GraspDesignName::Compliant];

/// Designs with a second grasp.
pub(super) const REGRASPS: [GraspDesignName; 3] =
    [GraspDesignName::RestPose, GraspDesignName::LivePose, GraspDesignName::Compliant];

/// A row of the paper's Table II.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperGrasp {
    /// Trials that held.
    pub held: usize,
    /// Trials.
    pub trials: usize,
    /// Trials that diverged.
    pub diverged: usize,
    /// Median lift (mm).
    pub lift_mm: f64,
    /// Median slip (mm).
    pub slip_mm: f64,
    /// Smallest and largest snap (mm); none for friction.
    pub snap_mm: Option<(f64, f64)>,
}

/// The paper's row of a design, for the first or the second grasp.
fn paper(design: GraspDesignName, regrasp: bool) -> Option<PaperGrasp> {
    let row = |held, trials, diverged, lift_mm, slip_mm, snap_mm| PaperGrasp {
        held,
        trials,
        diverged,
        lift_mm,
        slip_mm,
        snap_mm,
    };
    match (design, regrasp) {
        (GraspDesignName::Friction, false) => Some(row(0, 15, 0, 4.9, 10.1, None)),
        (GraspDesignName::RestPose, false) => Some(row(13, 15, 1, 15.1, 0.45, Some((4.7, 4.7)))),
        (GraspDesignName::LivePose, false) => Some(row(13, 15, 2, 15.2, 0.32, Some((0.0, 0.0)))),
        (GraspDesignName::RestPose, true) => Some(row(5, 5, 0, 15.4, 0.48, Some((4.3, 17.8)))),
        (GraspDesignName::LivePose, true) => Some(row(5, 5, 0, 15.2, 0.37, Some((0.0, 0.0)))),
        _ => None,
    }
}

/// One trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspTrial {
    /// The surroundings of the appendix.
    pub condition: Condition,
    /// Name of the design.
    pub design: String,
    /// Target organ coordinate.
    pub asked: f64,
    /// Organ coordinate of the grasped cluster.
    pub at: f64,
    /// Sideways offset of the jaws (mm).
    pub offset_mm: f64,
    /// Drag before the grasp (mm); none for a first grasp.
    pub drag_mm: Option<f64>,
    /// Whether the jaws attached the appendix.
    pub attached: bool,
    /// Whether it held: follow ratio at least 0.80 and slip under 3 mm.
    pub held: bool,
    /// Why it diverged, if it did.
    pub divergence: Option<String>,
    /// Why it did not pass.
    pub why: Option<String>,
    /// Lift (mm); 0 without a grasp.
    pub lift_mm: f64,
    /// Tissue lift over jaw lift; none without a grasp, as are the next figures.
    pub follow_ratio: Option<f64>,
    /// Slip (mm).
    pub slip_mm: Option<f64>,
    /// Largest snap of a node (mm); none for friction. Zero by construction for designs that
    /// capture nodes where they are.
    pub snap_mm: Option<f64>,
    /// Mean snap over the nodes (mm).
    pub snap_mean_mm: Option<f64>,
    /// Largest motion of a node in the first frame of the grasp (mm).
    pub activation_step_mm: Option<f64>,
    /// Mean displacement of the nodes from rest when the jaws closed (mm).
    pub displaced_mm: Option<f64>,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// Smallest volume of an element over its volume at rest.
    pub min_volume_ratio: f64,
    /// Substeps in which the grasp yielded.
    pub yielded_substeps: usize,
    /// Force of the tissue on the closed blades (N).
    pub closing_force_n: Option<f64>,
    /// Gap between the closed blades (mm).
    pub gap_mm: Option<f64>,
    /// Largest force of held nodes on the gripper (N).
    pub peak_constraint_n: f64,
    /// How often held tissue slipped.
    pub slipped: usize,
    /// Whether the tissue tore out.
    pub torn: bool,
    /// What was beyond what tissue withstands.
    pub warnings: Warnings,
    /// Time since the grasp (s), lift of the jaws and of the tissue (mm).
    pub lifts: Vec<(f64, f64, f64)>,
}

/// One row of Table II.
#[derive(Clone, Debug, Serialize)]
pub struct GraspDesignRow {
    /// The surroundings of the appendix.
    pub condition: Condition,
    /// Name of the design; starts with "re-grasp, " for the second grasp of dragged tissue.
    pub design: String,
    /// Trials that held.
    pub held: usize,
    /// Trials.
    pub trials: usize,
    /// Trials that diverged.
    pub diverged: usize,
    /// Median lift of the other trials (mm). The paper's figure is also a median.
    pub lift_median_mm: f64,
    /// Median slip of those with a grasp (mm); none without any, as are the next figures.
    pub slip_median_mm: Option<f64>,
    /// Largest slip (mm).
    pub slip_most_mm: Option<f64>,
    /// Largest snap of a trial (mm); none for friction.
    pub snap_mm: Option<f64>,
    /// Smallest snap of a trial (mm).
    pub snap_least_mm: Option<f64>,
    /// Median of the activation steps (mm).
    pub activation_step_median_mm: Option<f64>,
    /// Largest activation step (mm).
    pub activation_step_most_mm: Option<f64>,
    /// Median follow ratio.
    pub follow_ratio_median: Option<f64>,
    /// Largest number of inverted elements in any frame of any trial.
    pub inverted_peak: usize,
    /// Smallest volume of an element over its volume at rest in any trial.
    pub min_volume_ratio: f64,
    /// What was beyond what tissue withstands, in all trials.
    pub warnings: Warnings,
    /// The paper's row.
    pub paper: Option<PaperGrasp>,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct GraspDesignsResult {
    /// One row per design and condition.
    pub rows: Vec<GraspDesignRow>,
    /// All trials.
    pub trials: Vec<GraspTrial>,
    /// Jaw lift (mm).
    pub lift_mm: f64,
    /// Closing force of the jaws (N).
    pub jaw_force_n: f64,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// Density (kg/m3).
    pub density_kg_m3: f64,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Elements of the appendix.
    pub tets: usize,
    /// Trials of an earlier run.
    pub resumed: Resumed,
}

/// One row per design; those of the second grasp are last.
pub(super) fn rows(condition: Condition, trials: &[GraspTrial]) -> Vec<GraspDesignRow> {
    let first = DESIGNS.iter().map(|d| (*d, false));
    let again = REGRASPS.iter().map(|d| (*d, true));
    first.chain(again).filter_map(|(design, regrasp)| row(condition, design, regrasp, trials)).collect()
}

fn row(condition: Condition, design: GraspDesignName, regrasp: bool, trials: &[GraspTrial]) -> Option<GraspDesignRow> {
    let name = design_name(design);
    let is = |t: &&GraspTrial| t.condition == condition && t.design == name && t.drag_mm.is_some() == regrasp;
    let of: Vec<&GraspTrial> = trials.iter().filter(is).collect();
    let ended: Vec<&&GraspTrial> = of.iter().filter(|t| t.divergence.is_none()).collect();
    let values =
        |value: &dyn Fn(&GraspTrial) -> Option<f64>| -> Vec<f64> { ended.iter().filter_map(|t| value(t)).collect() };
    let median_of = |value: &dyn Fn(&GraspTrial) -> Option<f64>| {
        let mut values = values(value);
        (!values.is_empty()).then(|| median(&mut values))
    };
    let most = |value: &dyn Fn(&GraspTrial) -> Option<f64>| values(value).into_iter().reduce(f64::max);
    let snaps = || of.iter().filter_map(|t| t.snap_mm);
    (!of.is_empty()).then(|| GraspDesignRow {
        condition,
        design: format!("{}{name}", if regrasp { "re-grasp, " } else { "" }),
        held: of.iter().filter(|t| t.held).count(),
        trials: of.len(),
        diverged: of.len() - ended.len(),
        lift_median_mm: median(&mut values(&|t| Some(t.lift_mm))),
        slip_median_mm: median_of(&|t| t.slip_mm),
        slip_most_mm: most(&|t| t.slip_mm),
        snap_mm: snaps().reduce(f64::max),
        snap_least_mm: snaps().reduce(f64::min),
        activation_step_median_mm: median_of(&|t| t.activation_step_mm),
        activation_step_most_mm: most(&|t| t.activation_step_mm),
        follow_ratio_median: median_of(&|t| t.follow_ratio),
        inverted_peak: of.iter().map(|t| t.inverted_peak).max().unwrap_or(0),
        min_volume_ratio: of.iter().map(|t| t.min_volume_ratio).fold(1.0, f64::min),
        warnings: of.iter().map(|t| t.warnings).sum(),
        paper: paper(design, regrasp),
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A made-up trial; its figures depend on `k`.
    fn made_up(design: GraspDesignName, k: usize, drag_mm: Option<f64>) -> GraspTrial {
        let value = k as f64;
        let ties = design != GraspDesignName::Friction;
        GraspTrial {
            condition: Condition::Appendix,
            design: design_name(design).to_owned(),
            asked: 0.5 + 0.1 * (k / 3) as f64,
            at: 0.5 + 0.1 * (k / 3) as f64,
            offset_mm: 2.0 * (k % 3) as f64 - 2.0,
            drag_mm,
            attached: true,
            held: k != 1,
            divergence: (k == 1).then(|| "<b>made up</b>".to_owned()),
            why: None,
            lift_mm: 15.0 - value,
            follow_ratio: Some(1.0),
            slip_mm: Some(0.1 * value),
            snap_mm: ties.then_some(value),
            snap_mean_mm: ties.then_some(0.5 * value),
            activation_step_mm: Some(0.01 * value),
            displaced_mm: Some(0.6 * value),
            inverted_peak: k,
            min_volume_ratio: 0.5,
            yielded_substeps: 0,
            closing_force_n: Some(1.0),
            gap_mm: Some(4.0),
            peak_constraint_n: 0.2,
            slipped: 0,
            torn: false,
            warnings: Warnings { overstretched: 1, ..Warnings::default() },
            lifts: vec![(0.0, 0.0, 0.0), (1.0, 15.0, 15.0 - value)],
        }
    }

    /// A made-up result of all designs.
    pub(crate) fn made_up_result() -> GraspDesignsResult {
        let mut trials = Vec::new();
        for design in DESIGNS {
            trials.extend((0..15).map(|k| made_up(design, k, None)));
        }
        for design in REGRASPS {
            trials.extend((0..10).map(|k| made_up(design, k, Some(5.0))));
        }
        GraspDesignsResult {
            rows: rows(Condition::Appendix, &trials),
            trials,
            lift_mm: 15.0,
            jaw_force_n: 1.0,
            modulus_kpa: 12.0,
            density_kg_m3: 1200.0,
            nodes: 1,
            tets: 1,
            resumed: Resumed::default(),
        }
    }

    #[test]
    fn rows_summarize_their_trials() {
        let rows = made_up_result().rows;
        let names: Vec<&str> = rows.iter().map(|r| r.design.as_str()).collect();
        let again = ["re-grasp, rest-pose", "re-grasp, live-pose", "re-grasp, compliant"];
        assert_eq!(names[..4], ["friction", "rest-pose", "live-pose", "compliant"]);
        assert_eq!(names[4..], again);
        let live = &rows[2];
        assert_eq!((live.held, live.trials, live.diverged, live.inverted_peak), (14, 15, 1, 14));
        // The median of 0 to 14 without 1.
        assert!((live.lift_median_mm - (15.0 - 7.5)).abs() < 1e-12, "a diverged trial has no lift");
        assert_eq!((live.snap_mm, live.snap_least_mm, live.warnings.overstretched), (Some(14.0), Some(0.0), 15));
        assert_eq!(live.paper.map(|p| (p.held, p.diverged)), Some((13, 2)));
        assert_eq!((rows[0].snap_mm, rows[3].paper), (None, None));
        assert_eq!(rows[4].paper.and_then(|p| p.snap_mm), Some((4.3, 17.8)));
    }
}
