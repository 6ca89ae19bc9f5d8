//! A second grasp of displaced tissue through arm and port: the RCM deviation after it, with
//! rest-pose and live-pose capture, with and without the cell's safety rules.

mod page;
mod result;

use super::appendix::{Condition, FOLDER, LiftTrial, Whole, divergence, peak_constraint};
use crate::names::{AppendixChoice, design_name};
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use result::{PortRegraspResult, Regrasp};
use trocar_cell::CellEvent;
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_scene::{GraspDesignName, SafetyRules, Scene};
use trocar_task::Recording;
use trocar_task::policy::{AfterHold, Script};

/// Control periods after the second grasp, as in the paper.
const STEPS: usize = 60;

/// Deviation beyond which periods are counted (mm).
const THRESHOLD_MM: f64 = 3.0;

/// Ways to take hold the second time.
const DESIGNS: [GraspDesignName; 2] = [GraspDesignName::RestPose, GraspDesignName::LivePose];

/// No rule of the cell.
const NO_RULES: SafetyRules = SafetyRules { force_guard: false, strain_guard: false };

/// A re-grasp of dragged tissue through arm and port: RCM deviation after rest-pose and live-pose
/// capture, with and without the safety rules.
#[derive(Clone, Debug, Args)]
pub struct PortRegraspExperiment {
    /// The appendix.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// Drags before the second grasp (mm), up to 50.
    #[arg(long, value_delimiter = ',', default_values_t = [5.0, 10.0])]
    pub drag: Vec<f64>,
    /// Organ coordinate of the grasps, from 0 to 1.
    #[arg(long, default_value_t = 0.5)]
    pub at: f64,
    /// Trials in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// One run: its lift, and whether rules act.
type Task = (LiftTrial, bool);

impl Study for PortRegraspExperiment {
    const NAME: &'static str = "port-regrasp";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(FOLDER);
    const SCHEMA: u32 = 2;
    type Figures = PortRegraspResult;

    fn run(&self, job: &Job<'_>) -> Result<(PortRegraspResult, Document)> {
        if let Some(wrong) = self.drag.iter().find(|d| !(0.0..=50.0).contains(*d)) {
            return Err(Error::Mismatch(format!("--drag is {wrong} mm; it must be in [0, 50]")));
        }
        if !(0.0..=1.0).contains(&self.at) {
            return Err(Error::Mismatch(format!("--at is {}; it must be in [0, 1]", self.at)));
        }
        job.claim()?;
        let whole = Whole::read(&self.appendix, job.output(), job.progress)?;
        let (scene, specimen) = (whole.scene(Condition::Cell)?, whole.specimen(Condition::Cell));
        let tasks: Vec<Task> = tasks(self.at, &self.drag);
        let one = |(lift, rules): &Task, progress: &dyn Progress| -> Result<Regrasp> {
            let mut scene: Scene = scene.clone();
            if !rules {
                scene.safety.rules = NO_RULES;
            }
            Ok(regrasp(lift, *rules, &lift.run(&scene, &specimen, progress)?))
        };
        let settings = whole.fingerprint();
        let Outcomes { rows, resumed } = job.trials("trials", &settings, &tasks, key, self.threads, one)?;
        let result = PortRegraspResult { at: self.at, threshold_mm: THRESHOLD_MM, rows, resumed };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

/// The runs: every drag (mm) with both captures, with and without rules.
fn tasks(at: f64, drags: &[f64]) -> Vec<Task> {
    let mut tasks = Vec::new();
    for rules in [true, false] {
        for design in DESIGNS {
            for drag in drags {
                let script = Script { at, regrasp: Some(1e-3 * drag), after: AfterHold::Finish, ..Script::default() };
                let jaw_force = trocar_cell::JAW_FORCE;
                tasks.push((LiftTrial { condition: Condition::Cell, script, design, jaw_force }, rules));
            }
        }
    }
    tasks
}

/// The unique name of a run.
fn key((lift, rules): &Task) -> String {
    let (script, design) = (&lift.script, design_name(lift.design));
    format!("{design} at {}, drag {:?} m, rules {rules}", script.at, script.regrasp)
}

fn regrasp(lift: &LiftTrial, rules: bool, made: &Recording) -> Regrasp {
    let (s, details) = (&made.summary, &made.summary.details);
    let times = made.events.iter().filter(|(_, event)| matches!(event, CellEvent::Attached { .. }));
    let times: Vec<f64> = times.map(|(time, _)| *time).collect();
    // The first grasp drags, the second lifts.
    let start = times.get(1).copied();
    let after = made.channels.iter().filter(|c| start.is_some_and(|start| c.time_s >= start - 1e-9));
    let rcm_mm: Vec<f64> = after.take(STEPS).map(|c| c.left.rcm_peak_mm.max(c.right.rcm_peak_mm)).collect();
    Regrasp {
        design: lift.design_name(),
        rules,
        drag_mm: 1e3 * lift.script.regrasp.unwrap_or(0.0),
        grasped_twice: start.is_some(),
        displaced_mm: details.displaced_mm,
        snap_mm: details.snap_mm,
        pull_n: peak_constraint(made),
        rcm_peak_mm: rcm_mm.iter().copied().fold(0.0, f64::max),
        steps: rcm_mm.len(),
        steps_over: rcm_mm.iter().filter(|mm| **mm > THRESHOLD_MM).count(),
        rcm_mm,
        warnings: s.warnings,
        divergence: divergence(made),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_task::Warnings;

    #[test]
    fn every_drag_is_run_with_both_captures_with_and_without_rules() {
        let tasks = tasks(0.5, &[5.0, 10.0]);
        let mut keys: Vec<String> = tasks.iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!((tasks.len(), keys.len()), (8, 8));
    }

    #[test]
    fn the_page_names_what_is_missing() {
        let row = |rules, twice: bool| Regrasp {
            design: "rest-pose".to_owned(),
            rules,
            drag_mm: 5.0,
            grasped_twice: twice,
            displaced_mm: twice.then_some(4.0),
            snap_mm: twice.then_some(6.0),
            pull_n: 0.5,
            rcm_peak_mm: 3.5,
            steps: 2,
            steps_over: 1,
            rcm_mm: vec![0.1, 3.5],
            warnings: Warnings { overstretched: 1, ..Warnings::default() },
            divergence: None,
        };
        let rows = vec![row(true, true), row(false, false)];
        let result = PortRegraspResult { at: 0.5, threshold_mm: 3.0, rows, resumed: Default::default() };
        let html = page::document(&result).unwrap().page();
        assert!(html.contains("<svg") && html.contains("no second grasp") && !html.contains("NaN"));
    }
}
