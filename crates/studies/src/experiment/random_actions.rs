//! Random but legal actions in a scene's cell: whether anything breaks.

use super::trials::{Resumed, Trials};
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_cell::{Cell, CellEvent, Policy, RandomActions};
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_workflow::REPORT;
use trocar_workflow::scene_specimen;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "random-actions.json";

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct RandomActionsExperiment {
    /// Scene file or built-in scene.
    pub scene: String,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
    /// Seeds: this and as many more as make `seeds`.
    pub first_seed: u64,
    /// How many seeds.
    pub seeds: u64,
    /// Actions a seed.
    pub actions: usize,
    /// Seeds that are run at once, 0 for as many as there are threads.
    pub threads: usize,
}

/// One seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomActionsRow {
    /// The seed.
    pub seed: u64,
    /// Actions that were done.
    pub actions: usize,
    /// What ended the run before its time, if anything did.
    pub diverged: Option<String>,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// Largest length of an edge over that at rest, at the end of any action.
    pub max_stretch: f64,
    /// Least volume of an element over that at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Joints found beyond their limits, added up over all actions.
    pub joint_limits_broken: usize,
    /// Largest RCM deviation [mm].
    pub rcm_max_mm: f64,
    /// Largest force on an instrument [N].
    pub force_max_n: f64,
    /// How often an instrument let go of what it had pierced, hooked or crushed.
    pub unhooked: usize,
    /// How often an organ that was folded for good was put right.
    pub relaxed: usize,
    /// Arms and periods in which the force guard shortened a command.
    pub guarded: usize,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct RandomActionsResult {
    /// The scene's name.
    pub scene: String,
    /// Seed by seed.
    pub rows: Vec<RandomActionsRow>,
    /// Actions of all seeds.
    pub actions: usize,
    /// Nothing diverged, no element was inverted, no joint left its limits.
    pub unbroken: bool,
    /// What an earlier run had done.
    pub resumed: Resumed,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl RandomActionsExperiment {
    /// Runs everything into the folder `output`: trials, figures and report.
    ///
    /// # Errors
    /// A scene or specimen that cannot be had, a folder that cannot be written, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<RandomActionsResult> {
        let clock = Instant::now();
        let scene = Scene::read(&self.scene)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        super::claim(output, MARKER)?;
        let places = specimen.organs.iter().flat_map(|o| &o.body.vertices);
        let sum: f64 = places.map(|p| p.x + 2.0 * p.y + 3.0 * p.z).sum();
        let settings = format!("{scene:?}\n{sum:?}\n{}", self.actions);
        let trials = Trials::open(output, "random-actions", &settings)?;
        let seeds: Vec<u64> = (0..self.seeds).map(|k| self.first_seed.saturating_add(k)).collect();
        let one = |seed: &u64, progress: &dyn Progress| run(&scene, &specimen, *seed, self.actions, progress);
        let made = trials.run("random actions", &seeds, |seed| format!("seed {seed}"), self.threads, progress, one)?;
        let whole = |r: &RandomActionsRow| {
            r.diverged.is_none() && r.inverted_peak == 0 && r.joint_limits_broken == 0 && r.actions == self.actions
        };
        let result = RandomActionsResult {
            scene: scene.name.clone(),
            actions: made.rows.iter().map(|r| r.actions).sum(),
            unbroken: made.rows.iter().all(whole),
            rows: made.rows,
            resumed: made.resumed,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::random_actions(&result).as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }
}

fn run(
    scene: &Scene,
    specimen: &Specimen,
    seed: u64,
    actions: usize,
    progress: &dyn Progress,
) -> Result<RandomActionsRow> {
    let mut cell = Cell::new(scene, specimen, 1)?;
    let arms: Vec<&str> = cell.observe().iter().map(|arm| arm.side.name()).collect();
    let mut policy = RandomActions::new(seed, &arms);
    let mut row = RandomActionsRow {
        seed,
        actions: 0,
        diverged: None,
        inverted_peak: 0,
        max_stretch: 1.0,
        min_volume_ratio: 1.0,
        joint_limits_broken: 0,
        rcm_max_mm: 0.0,
        force_max_n: 0.0,
        unhooked: 0,
        relaxed: 0,
        guarded: 0,
    };
    while row.actions < actions && row.diverged.is_none() {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let Some(action) = policy.act(&cell)? else { break };
        let report = cell.step(&action)?;
        row.actions += 1;
        row.diverged = report.tissue.divergence.map(|d| d.to_string());
        row.inverted_peak = row.inverted_peak.max(report.tissue.inverted);
        row.max_stretch = row.max_stretch.max(cell.max_stretch());
        row.min_volume_ratio = row.min_volume_ratio.min(report.tissue.min_volume_ratio);
        for arm in &report.arms {
            row.rcm_max_mm = row.rcm_max_mm.max(1e3 * arm.rcm_peak);
            row.force_max_n = row.force_max_n.max((arm.contact + arm.constraint).length());
            row.guarded += usize::from(arm.guarded);
            let q = cell.measured_js(arm.side.name())?.position;
            let limits = cell.joint_limits(arm.side.name())?;
            row.joint_limits_broken += q.iter().zip(&limits).filter(|(q, [a, b])| !(*a..=*b).contains(q)).count();
        }
        for event in &report.events {
            row.unhooked += usize::from(matches!(event, CellEvent::Unhooked { .. }));
            row.relaxed += usize::from(matches!(event, CellEvent::Relaxed { .. }));
        }
    }
    Ok(row)
}
