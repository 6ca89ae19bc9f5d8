//! Random valid actions in the cell of a scene: whether tissue or arms diverge.

use crate::Result;
use crate::names::SceneChoice;
use crate::study::{Job, Kind, Study};
use crate::trials::{Outcomes, Resumed, resumed};
use clap::Args;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_cell::Cell;
use trocar_core::Progress;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::table::{count, fixed, percent};
use trocar_scene::{Scene, TaskName};
use trocar_specimen::Specimen;
use trocar_task::policy::RandomActions;
use trocar_task::{ArmChannels, End, Episode, Policy, Warnings};
use trocar_workflow::{check_interrupted, scene_specimen};

/// Threshold of the RCM deviation (mm). With that of the scene the episode would end early.
const RCM_THRESHOLD_MM: f64 = 25.0;

/// Random valid actions in the cell of a scene: whether tissue or arms diverge.
#[derive(Clone, Debug, Args)]
pub struct RandomActionsExperiment {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// First seed. Every fourth seed (3, 7, ...) moves the tips; the others set coordinates in the
    /// ports.
    #[arg(long, default_value_t = 0)]
    pub first_seed: u64,
    /// Number of seeds.
    #[arg(long, default_value_t = 20)]
    pub seeds: u64,
    /// Actions per seed.
    #[arg(long, default_value_t = 500)]
    pub actions: usize,
    /// Seeds in parallel; all threads by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Figures of one seed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RandomActionsRow {
    /// The seed.
    pub seed: u64,
    /// Number of actions.
    pub actions: usize,
    /// Why the run ended early, if it did.
    pub diverged: Option<String>,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// Largest length of an edge over that at rest, after any action.
    pub max_stretch: f64,
    /// Smallest volume of an element over that at rest, in any frame.
    pub min_volume_ratio: f64,
    /// Joints beyond their limits, summed over all actions.
    pub joint_limits_broken: usize,
    /// Largest RCM deviation (mm).
    pub rcm_max_mm: f64,
    /// Largest force on an instrument (N).
    pub force_max_n: f64,
    /// Way of both tips (m).
    #[serde(default)]
    pub path_m: f64,
    /// Actions after which an instrument's axis was inside an organ that it had not punctured, over
    /// both arms.
    #[serde(default)]
    pub axes_inside: usize,
    /// What was beyond what tissue withstands.
    #[serde(flatten)]
    pub warnings: Warnings,
    /// How often the force guard shortened a command, over all arms and periods.
    pub guarded: usize,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct RandomActionsResult {
    /// Name of the scene.
    pub scene: String,
    /// Rows of the seeds.
    pub rows: Vec<RandomActionsRow>,
    /// Actions of all seeds.
    pub actions: usize,
    /// How often a rule switched physics off, in 1,000 actions: never, since none does. Tables of
    /// earlier programs have other numbers here.
    pub suspensions_per_1000_actions: f64,
    /// What was beyond what tissue withstands, in 1,000 actions.
    pub warnings_per_1000_actions: f64,
    /// Actions after which an instrument's axis was inside an organ that it had not punctured, of
    /// all seeds.
    pub axes_inside: usize,
    /// What was beyond what tissue withstands, in all seeds.
    #[serde(flatten)]
    pub warnings: Warnings,
    /// Largest number of inverted elements in any frame of any seed.
    pub inverted_peak: usize,
    /// Seeds that diverged.
    pub diverged: usize,
    /// Way of both tips in all seeds (m).
    pub path_m: f64,
    /// Whether all runs were complete, without divergence, inverted elements or joints beyond their
    /// limits.
    pub unbroken: bool,
    /// Seeds of an earlier run.
    pub resumed: Resumed,
}

impl Study for RandomActionsExperiment {
    const NAME: &'static str = "random-actions";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of trials and report. Finished seeds in it are used again.");
    const SCHEMA: u32 = 2;
    type Figures = RandomActionsResult;

    fn run(&self, job: &Job<'_>) -> Result<(RandomActionsResult, Document)> {
        let scene = Scene::read(&self.scene.scene)?;
        let specimen = scene_specimen(&scene, &self.scene.phantoms, job.progress)?;
        job.claim()?;
        let places = specimen.organs.iter().flat_map(|o| &o.body.vertices);
        let sum: f64 = places.map(|p| p.x + 2.0 * p.y + 3.0 * p.z).sum();
        let settings = format!("{scene:?}\n{sum:?}\n{}", self.actions);
        let seeds: Vec<u64> = (0..self.seeds).map(|k| self.first_seed.saturating_add(k)).collect();
        let one = |seed: &u64, progress: &dyn Progress| run(&scene, &specimen, *seed, self.actions, progress);
        let key = |seed: &u64| format!("seed {seed}");
        let Outcomes { rows, resumed } = job.trials("random actions", &settings, &seeds, key, self.threads, one)?;
        let whole = |r: &RandomActionsRow| {
            r.diverged.is_none() && r.inverted_peak == 0 && r.joint_limits_broken == 0 && r.actions == self.actions
        };
        let sum = |of: fn(&RandomActionsRow) -> usize| rows.iter().map(of).sum::<usize>();
        let actions = sum(|r| r.actions);
        let warnings: Warnings = rows.iter().map(|r| r.warnings).sum();
        let result = RandomActionsResult {
            scene: scene.name.clone(),
            actions,
            suspensions_per_1000_actions: 0.0,
            warnings_per_1000_actions: 1e3 * warnings.total() as f64 / actions.max(1) as f64,
            warnings,
            axes_inside: sum(|r| r.axes_inside),
            inverted_peak: rows.iter().map(|r| r.inverted_peak).max().unwrap_or(0),
            diverged: sum(|r| usize::from(r.diverged.is_some())),
            path_m: rows.iter().map(|r| r.path_m).sum(),
            unbroken: rows.iter().all(whole),
            rows,
            resumed,
        };
        let document = document(&result);
        Ok((result, document))
    }
}

/// The scene without a task: the episode ends after the last action.
fn endless(scene: &Scene, actions: usize) -> Scene {
    let mut scene = scene.clone();
    scene.task.name = TaskName::PortReach;
    scene.task.stop_when_passed = false;
    scene.task.episode_s = actions as f64 / f64::from(scene.rates.control_hz);
    // Larger deviations are recorded; hardware would stop.
    (scene.safety.rcm_threshold_mm, scene.safety.rcm_abort_mm) = (RCM_THRESHOLD_MM, 2.0 * RCM_THRESHOLD_MM);
    scene
}

fn run(
    scene: &Scene,
    specimen: &Specimen,
    seed: u64,
    actions: usize,
    progress: &dyn Progress,
) -> Result<RandomActionsRow> {
    let mut episode = Episode::new(&endless(scene, actions), specimen, 1)?;
    episode.reset(seed)?;
    let mut policy = RandomActions::default();
    policy.begin(&episode, seed)?;
    let mut row = RandomActionsRow { seed, max_stretch: 1.0, min_volume_ratio: 1.0, ..RandomActionsRow::default() };
    let tips = |cell: &Cell| -> Vec<DVec3> { cell.observe().iter().map(|arm| arm.tip.translation).collect() };
    let mut at = tips(episode.cell());
    'episode: while row.actions < actions && episode.end().is_none() {
        for action in policy.act(&episode)? {
            check_interrupted(progress)?;
            let step = episode.step(&action)?;
            row.actions += 1;
            row.max_stretch = row.max_stretch.max(episode.max_stretch());
            row.joint_limits_broken += joint_limits_broken(episode.cell())?;
            let now = tips(episode.cell());
            row.path_m += at.iter().zip(&now).map(|(a, b)| a.distance(*b)).sum::<f64>();
            row.axes_inside += episode.cell().axes_inside().into_iter().filter(|is| *is).count();
            at = now;
            if step.end.is_some() {
                break 'episode;
            }
        }
    }
    let s = episode.summary();
    row.diverged = match episode.end() {
        Some(end @ (End::Diverged { .. } | End::RcmAbort { .. })) => Some(end.to_string()),
        _ => None,
    };
    row.inverted_peak = s.inverted_peak;
    row.min_volume_ratio = s.min_volume_ratio;
    row.rcm_max_mm = s.rcm_peak_mm;
    let force = |arm: &ArmChannels| {
        let sum = [
            arm.contact_x_n + arm.constraint_x_n,
            arm.contact_y_n + arm.constraint_y_n,
            arm.contact_z_n + arm.constraint_z_n,
        ];
        DVec3::from(sum).length()
    };
    row.force_max_n = episode.rows().iter().flat_map(|c| c.arms().map(force)).fold(0.0, f64::max);
    row.warnings = s.warnings;
    row.guarded = s.arms.iter().map(|a| a.guarded).sum();
    Ok(row)
}

/// Number of joints beyond their limits.
fn joint_limits_broken(cell: &Cell) -> Result<usize> {
    let mut broken = 0;
    for (side, _) in cell.arms() {
        let limits = cell.joint_limits(side.name())?;
        if !limits.is_empty() {
            let q = cell.measured_js(side.name())?.position;
            broken += q.iter().zip(&limits).filter(|(q, [a, b])| !(*a..=*b).contains(q)).count();
        }
    }
    Ok(broken)
}

fn document(r: &RandomActionsResult) -> Document {
    let lead = format!(
        "Random valid actions in the cell of {}, from {} seeds. An instrument that comes through the surface of an \
         organ with the scene's force punctures it. No rule switches physics off. \
         What is beyond what tissue withstands is counted.",
        page::escape(&r.scene),
        r.rows.len()
    );
    let good = r.rows.iter().filter(|row| row.diverged.is_none() && row.inverted_peak == 0).count();
    let broken: usize = r.rows.iter().map(|row| row.joint_limits_broken).sum();
    let cards = [
        Card::new("Actions", count(r.actions), "of all seeds"),
        Card::new("Seeds without failure", format!("{good} of {}", r.rows.len()), "no divergence, no inverted element")
            .met(good == r.rows.len()),
        Card::new("Warnings", fixed(r.warnings_per_1000_actions, 2), "in 1,000 actions: beyond what tissue withstands"),
        Card::new("Punctures", count(r.warnings.punctures), "organs punctured by instruments"),
        Card::new("Axes inside organs", count(r.axes_inside), "actions after which one is inside without a puncture")
            .met(r.axes_inside == 0),
        Card::new("Joints beyond their limits", count(broken), "over all actions").met(broken == 0),
    ];
    let table = Table::of(
        &r.rows,
        &[
            ("Seed", &|row| row.seed.to_string()),
            ("Actions", &|row| count(row.actions)),
            ("Diverged", &|row| row.diverged.clone().unwrap_or_default()),
            ("Inverted", &|row| count(row.inverted_peak)),
            ("Stretch", &|row| fixed(row.max_stretch, 2)),
            ("Smallest volume", &|row| percent(row.min_volume_ratio, 2)),
            ("RCM (mm)", &|row| fixed(row.rcm_max_mm, 2)),
            ("Force (N)", &|row| fixed(row.force_max_n, 2)),
            ("Way (m)", &|row| fixed(row.path_m, 2)),
            ("Actions with an axis inside", &|row| count(row.axes_inside)),
            ("Punctures", &|row| count(row.warnings.punctures)),
            ("Pierced", &|row| count(row.warnings.pierced)),
            ("Overstretched", &|row| count(row.warnings.overstretched)),
            ("Folded", &|row| count(row.warnings.folded)),
            ("Guarded", &|row| count(row.guarded)),
        ],
    );
    Document::new("Random actions", "Failures under random valid actions")
        .with(Section::new("Random actions", lead).cards(cards))
        .with(Section::new("Seeds", "").table(table).lines(resumed(&r.resumed, "seed")))
}
