//! Table II and Fig. 7(a) to (c): four grasp designs at five places of the appendix and from three
//! sides, and again after a drag. Measured in the whole cell and with the appendix alone.

mod page;
mod result;

use super::appendix::{Condition, ConditionName, FOLDER, LiftTrial, Whole, appendix, divergence, peak_constraint};
use crate::names::{AppendixChoice, design_name, millimetres};
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use result::{DESIGNS, GraspDesignsResult, GraspTrial, REGRASPS, rows};
use trocar_cell::{Cell, CellEvent, clusters};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_scene::{GraspDesignName, MaterialOverride, Scene};
use trocar_specimen::{Material, Specimen};
use trocar_task::Recording;
use trocar_task::policy::{AfterHold, Script};

/// Number of places on the appendix.
const LOCATIONS: usize = 5;

/// Sideways offsets of the jaws from the middle of the appendix (m).
const OFFSETS: [f64; 3] = [-0.002, 0.0, 0.002];

/// Drags before the second grasp (m).
const DRAGS: [f64; 2] = [0.005, 0.010];

/// Table II and Fig. 7(a) to (c): four grasp designs at five places and from three sides, and again
/// after a drag.
#[derive(Clone, Debug, Args)]
pub struct GraspDesignsExperiment {
    /// The appendix.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// Lift in the whole cell, the appendix alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Lift of the jaws (mm).
    #[arg(long, default_value = "15", value_parser = millimetres)]
    pub lift: f64,
    /// Closing force of the jaws (N).
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Trials in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// A condition: scene and specimen with the material of the paper.
struct Setup {
    condition: Condition,
    scene: Scene,
    specimen: Specimen,
    /// Organ coordinates of the places.
    places: Vec<f64>,
}

impl Study for GraspDesignsExperiment {
    const NAME: &'static str = "grasp-designs";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(FOLDER);
    const SCHEMA: u32 = 3;
    type Figures = GraspDesignsResult;

    fn run(&self, job: &Job<'_>) -> Result<(GraspDesignsResult, Document)> {
        job.claim()?;
        let whole = Whole::read(&self.appendix, job.output(), job.progress)?;
        let material = Material::default();
        let conditions = self.condition.conditions();
        let setups: Vec<Setup> = conditions.iter().map(|c| Setup::new(&whole, *c, material)).collect::<Result<_>>()?;
        let tasks: Vec<(&Setup, LiftTrial)> =
            setups.iter().flat_map(|s| self.tasks(s).into_iter().map(move |t| (s, t))).collect();
        let settings = format!("{} N, {} m, {}", self.jaw_force, self.lift, whole.fingerprint());
        let one = |(setup, task): &(&Setup, LiftTrial), progress: &dyn Progress| -> Result<GraspTrial> {
            Ok(trial(task, &task.run(&setup.scene, &setup.specimen, progress)?))
        };
        let Outcomes { rows: trials, resumed } =
            job.trials("trials", &settings, &tasks, |(_, task)| key(task), self.threads, one)?;
        let (nodes, tets) = whole.size();
        let result = GraspDesignsResult {
            rows: conditions.iter().flat_map(|c| rows(*c, &trials)).collect(),
            trials,
            lift_mm: 1e3 * self.lift,
            jaw_force_n: self.jaw_force,
            modulus_kpa: 1e-3 * material.young_modulus_pa,
            density_kg_m3: material.density_kg_m3,
            nodes,
            tets,
            resumed,
        };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl GraspDesignsExperiment {
    fn tasks(&self, setup: &Setup) -> Vec<LiftTrial> {
        let task = |design, at: f64, approach_offset, regrasp| LiftTrial {
            condition: setup.condition,
            script: Script { at, approach_offset, lift: self.lift, regrasp, retries: 0, after: AfterHold::Finish },
            design,
            jaw_force: self.jaw_force,
        };
        let mut tasks = Vec::new();
        for design in DESIGNS {
            tasks.extend(setup.places.iter().flat_map(|at| OFFSETS.map(|offset| task(design, *at, offset, None))));
        }
        for design in REGRASPS {
            tasks.extend(setup.places.iter().flat_map(|at| DRAGS.map(|drag| task(design, *at, 0.0, Some(drag)))));
        }
        tasks
    }
}

impl Setup {
    fn new(whole: &Whole, condition: Condition, material: Material) -> Result<Self> {
        let (mut scene, specimen) = (whole.scene(condition)?, whole.specimen(condition));
        appendix(&mut scene).material = MaterialOverride {
            young_modulus_pa: Some(material.young_modulus_pa),
            poisson_ratio: Some(material.poisson_ratio),
            density_kg_m3: Some(material.density_kg_m3),
            ..MaterialOverride::default()
        };
        let places = places(&scene, &specimen)?;
        Ok(Self { condition, scene, specimen, places })
    }
}

/// Places at equal distances over the part of the organ that can be grasped and lifted.
fn places(scene: &Scene, specimen: &Specimen) -> Result<Vec<f64>> {
    let cell = Cell::new(scene, specimen, 1)?;
    let bodies = cell.world().model.bodies();
    let organ = bodies.iter().position(|b| b.name() == scene.task.organ).unwrap_or(0);
    let clear: Vec<f64> = clusters(cell.world(), organ).iter().filter(|c| c.clear).map(|c| c.s).collect();
    let (Some(first), Some(last)) = (clear.first(), clear.last()) else {
        return Err(Error::Mismatch("no part of the appendix is clear of pins; pin fewer nodes".to_owned()));
    };
    Ok((0..LOCATIONS).map(|k| first + (last - first) * k as f64 / (LOCATIONS - 1) as f64).collect())
}

/// The unique name of a trial.
fn key(task: &LiftTrial) -> String {
    let (condition, design, script) = (task.condition.name(), design_name(task.design), &task.script);
    let (at, offset, drag) = (script.at, script.approach_offset, script.regrasp);
    format!("{condition}, {design} at {at}, offset {offset} m, drag {drag:?} m")
}

fn trial(task: &LiftTrial, made: &Recording) -> GraspTrial {
    let (s, d) = (&made.summary, &made.summary.details);
    let ties = task.design != GraspDesignName::Friction;
    let attached = made.events.iter().rev().find(|(_, e)| matches!(e, CellEvent::Attached { .. }));
    let start = attached.map_or(f64::INFINITY, |(time, _)| *time);
    let lifted = made.channels.iter().filter(|c| c.time_s >= start - 1e-9);
    GraspTrial {
        condition: task.condition,
        design: task.design_name(),
        asked: task.script.at,
        at: s.grasp_at.unwrap_or(task.script.at),
        offset_mm: 1e3 * task.script.approach_offset,
        drag_mm: task.script.regrasp.map(|d| 1e3 * d),
        attached: s.attached,
        held: s.held,
        divergence: divergence(made),
        why: s.why.clone(),
        lift_mm: s.lift_mm.unwrap_or(0.0),
        follow_ratio: s.follow_ratio,
        slip_mm: s.slip_mm,
        snap_mm: d.snap_mm.filter(|_| ties),
        snap_mean_mm: d.snap_mean_mm.filter(|_| ties),
        activation_step_mm: d.activation_step_mm,
        displaced_mm: d.displaced_mm,
        inverted_peak: s.inverted_peak,
        min_volume_ratio: s.min_volume_ratio,
        yielded_substeps: s.yielded_substeps,
        closing_force_n: d.closing_force_n,
        gap_mm: d.gap_mm,
        peak_constraint_n: peak_constraint(made),
        slipped: d.slipped,
        torn: s.torn > 0,
        warnings: s.warnings,
        lifts: lifted.map(|c| (c.time_s - start, c.task.jaw_lift_mm, c.task.lift_mm)).collect(),
    }
}
