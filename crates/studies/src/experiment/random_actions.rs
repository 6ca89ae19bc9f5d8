//! Random but legal actions in a scene's cell: whether anything breaks.

use super::trials::{Resumed, Trials, resumed};
use crate::names::SceneChoice;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::{Deserialize, Serialize};
use trocar_cell::{Cell, CellEvent, Policy, RandomActions};
use trocar_core::Progress;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::table::{count, fixed, percent};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_workflow::scene_specimen;

/// Random but legal actions in a scene's cell: whether tissue or arms break.
#[derive(Clone, Debug, Args)]
pub struct RandomActionsExperiment {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// First seed; every fourth (3, 7, ...) moves the tips, the others ask for coordinates in the ports.
    #[arg(long, default_value_t = 0)]
    pub first_seed: u64,
    /// Number of seeds.
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Actions a seed.
    #[arg(long, default_value_t = 500)]
    pub actions: usize,
    /// Seeds that are run at once; as many as there are threads by default.
    #[arg(long, default_value_t = 0)]
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

impl Study for RandomActionsExperiment {
    const NAME: &'static str = "random-actions";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some("Folder for trials and report; finished seeds in it are not run again.");
    type Figures = RandomActionsResult;

    fn run(&self, job: &Job<'_>) -> Result<(RandomActionsResult, Document)> {
        let scene = Scene::read(&self.scene.scene)?;
        let specimen = scene_specimen(&scene, &self.scene.phantoms, job.progress)?;
        job.claim()?;
        let places = specimen.organs.iter().flat_map(|o| &o.body.vertices);
        let sum: f64 = places.map(|p| p.x + 2.0 * p.y + 3.0 * p.z).sum();
        let settings = format!("{scene:?}\n{sum:?}\n{}", self.actions);
        let trials = Trials::open(job.output(), "random-actions", &settings)?;
        let seeds: Vec<u64> = (0..self.seeds).map(|k| self.first_seed.saturating_add(k)).collect();
        let one = |seed: &u64, progress: &dyn Progress| run(&scene, &specimen, *seed, self.actions, progress);
        let made =
            trials.run("random actions", &seeds, |seed| format!("seed {seed}"), self.threads, job.progress, one)?;
        let whole = |r: &RandomActionsRow| {
            r.diverged.is_none() && r.inverted_peak == 0 && r.joint_limits_broken == 0 && r.actions == self.actions
        };
        let result = RandomActionsResult {
            scene: scene.name.clone(),
            actions: made.rows.iter().map(|r| r.actions).sum(),
            unbroken: made.rows.iter().all(whole),
            rows: made.rows,
            resumed: made.resumed,
            seconds: job.seconds(),
            report: job.report(),
        };
        let document = document(&result);
        Ok((result, document))
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

fn document(r: &RandomActionsResult) -> Document {
    let lead = format!(
        "Random but legal actions in the cell of {}, from {} seeds. An instrument that pierces, hooks or crushes tissue lets go of it and passes through until it is out; an organ folded for good is put \
         right. Both are counted.",
        page::escape(&r.scene),
        r.rows.len()
    );
    let good = r.rows.iter().filter(|row| row.diverged.is_none() && row.inverted_peak == 0).count();
    let broken: usize = r.rows.iter().map(|row| row.joint_limits_broken).sum();
    let cards = [
        Card::new("Actions", count(r.actions), "done"),
        Card::new("Seeds unbroken", format!("{good} of {}", r.rows.len()), "no divergence, no inverted element")
            .met(good == r.rows.len()),
        Card::new("Joint limits broken", count(broken), "over all actions").met(broken == 0),
    ];
    let head = [
        "Seed",
        "Actions",
        "Diverged",
        "Inverted",
        "Stretch",
        "Least volume",
        "RCM [mm]",
        "Force [N]",
        "Unhooked",
        "Put right",
        "Guarded",
    ];
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .map(|row| {
            vec![
                row.seed.to_string(),
                count(row.actions),
                row.diverged.clone().unwrap_or_default(),
                count(row.inverted_peak),
                fixed(row.max_stretch, 2),
                percent(row.min_volume_ratio, 2),
                fixed(row.rcm_max_mm, 2),
                fixed(row.force_max_n, 2),
                count(row.unhooked),
                count(row.relaxed),
                count(row.guarded),
            ]
        })
        .collect();
    let seeds = Section::new("Seed by seed", "").table(Table::new(head, rows)).lines(resumed(&r.resumed, "seeds"));
    Document::new("Random actions", "What breaks under random but legal actions")
        .with(Section::new("Random actions", lead).cards(cards))
        .with(seeds)
}
