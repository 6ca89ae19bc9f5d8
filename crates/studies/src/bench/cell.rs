//! What a whole cell costs: two arms, two instruments, all organs, moving, no cameras.
//!
//! The left arm does the scripted grasp-lift while the right arm swings in its port. A second cell
//! in which organs pass through each other gets the same actions, period beside period, so that the
//! cost of contact between organs is the difference.

use super::machine::Machine;
use crate::Result;
use crate::names::SceneChoice;
use crate::statistics::median;
use crate::study::{Job, Kind, Study, stop_if_asked};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use trocar_cell::{Action, Cell, ContactParts, Setpoint};
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::policy::{Script, Scripted};
use trocar_task::{Episode, Policy, SETTLE_S};
use trocar_workflow::scene_specimen;
use trocar_workflow::specimen_scene::{grasp_lift, task_organ};

/// How the right arm swings: amplitude of its pivots (rad) and its frequency (Hz).
const SWING: (f64, f64) = (0.1, 0.5);

/// Speed of the whole two-arm cell, and the cost of its parts.
#[derive(Clone, Debug, Args)]
pub struct CellBench {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// A specimen folder instead of the scene's specimen.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// The benchmark's outcome. Times are means over control periods, in milliseconds of wall time.
#[derive(Clone, Debug, Serialize)]
pub struct CellBenchResult {
    /// Simulated over wall time of the whole cell, from the settling on.
    pub real_time_factor: f64,
    /// The same if organs passed through each other.
    pub real_time_factor_without_organ_contact: f64,
    /// Controllers, ports and dynamics of the arms.
    pub arms_ms: f64,
    /// Contact of organs with each other: tissue with it less tissue without.
    pub contact_ms: f64,
    /// Tissue without that: elasticity, supports, contact with the instruments, grasp.
    pub tissue_ms: f64,
    /// All else: jaws, mouths, observations.
    pub rest_ms: f64,
    /// A control period, median.
    pub median_ms: f64,
    /// The slowest.
    pub worst_ms: f64,
    /// Length of a control period (ms).
    pub period_ms: f64,
    /// Control periods that were timed.
    pub periods: usize,
    /// The lift held.
    pub attached: bool,
    /// Organs.
    pub organs: usize,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub tets: usize,
    /// Worker threads.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

impl Study for CellBench {
    const NAME: &'static str = "cell";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    type Figures = CellBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(CellBenchResult, Document)> {
        let progress = job.progress;
        let scene = Scene::read(&self.scene.scene)?;
        let specimen = match &self.specimen {
            Some(folder) => Specimen::read(folder)?,
            None => scene_specimen(&scene, &self.scene.phantoms, progress)?,
        };
        let machine = Machine::here();
        let mut lifting = scene.clone();
        let organ = task_organ(&specimen, Some(&scene.task.organ))?;
        lifting.task = trocar_scene::Task { grasp: scene.task.grasp, ..grasp_lift(organ) };
        let mut episode = Episode::new(&lifting, &specimen, self.threads)?;
        let parts = ContactParts { organs: false, ..ContactParts::default() };
        let mut apart = Cell::with_contact(&lifting, &specimen, self.threads, parts)?;
        apart.settle(SETTLE_S)?;
        let mut policy = Scripted::following(Script::default());
        policy.begin(&episode, 0)?;
        let right: Option<Setpoint> = episode.cell().setpoint("right").ok();
        let (from, apart_from) = (episode.cell().timing(), apart.timing());
        let mut times = Vec::new();
        progress.begin("cell", 1);
        while episode.end().is_none() {
            let chunk = policy.act(&episode)?;
            if chunk.is_empty() {
                break;
            }
            for mut action in chunk {
                stop_if_asked(progress)?;
                if let Some(right) = &right {
                    swing(&mut action, right, episode.time());
                }
                let before = episode.cell().timing().all;
                // Each first in every second period, so that what disturbs the machine disturbs
                // both.
                if times.len().is_multiple_of(2) {
                    episode.step(&action)?;
                    apart.step(&action)?;
                } else {
                    apart.step(&action)?;
                    episode.step(&action)?;
                }
                times.push(1e3 * (episode.cell().timing().all - before).as_secs_f64());
            }
        }
        progress.end();
        let cell = episode.cell();
        let n = times.len().max(1) as f64;
        let (now, apart_now) = (cell.timing(), apart.timing());
        let ms = |a: std::time::Duration, b: std::time::Duration| 1e3 * (a - b).as_secs_f64() / n;
        let (all, arms) = (ms(now.all, from.all), ms(now.arms, from.arms));
        let (tissue, without) = (ms(now.tissue, from.tissue), ms(apart_now.tissue, apart_from.tissue));
        let period_ms = 1e3 * cell.period();
        let bodies = cell.world().model.bodies();
        let worst_ms = times.iter().copied().fold(0.0, f64::max);
        let result = CellBenchResult {
            real_time_factor: period_ms / all,
            real_time_factor_without_organ_contact: period_ms / ms(apart_now.all, apart_from.all),
            arms_ms: arms,
            contact_ms: tissue - without,
            tissue_ms: without,
            rest_ms: all - arms - tissue,
            median_ms: median(&mut times),
            worst_ms,
            period_ms,
            periods: times.len(),
            attached: cell.observe().first().is_some_and(|a| a.attached),
            organs: bodies.len(),
            nodes: bodies.iter().map(|b| b.len()).sum(),
            tets: bodies.iter().map(|b| b.tets().len()).sum(),
            threads: if self.threads == 0 { machine.cores } else { self.threads },
            machine,
        };
        let document = document(&result);
        Ok((result, document))
    }
}

/// The right arm's numbers of an action, which are the second five.
fn swing(action: &mut Action, at: &Setpoint, time: f64) {
    let phase = std::f64::consts::TAU * SWING.1 * time;
    // It swings up from its start, away from the tissue and back.
    let turned = [at.0[0] + SWING.0 * phase.sin(), at.0[1] + 0.5 * SWING.0 * (1.0 - phase.cos())];
    if let Some(numbers) = action.numbers.get_mut(5..7) {
        numbers.copy_from_slice(&turned);
    }
}

fn document(r: &CellBenchResult) -> Document {
    let head = [
        "",
        "times real time",
        "arms (ms)",
        "contact of organs (ms)",
        "tissue (ms)",
        "rest (ms)",
        "median (ms)",
        "worst (ms)",
    ];
    let times = [r.arms_ms, r.contact_ms, r.tissue_ms, r.rest_ms, r.median_ms, r.worst_ms].map(|ms| fixed(ms, 2));
    let rows = vec![
        ["whole cell".to_owned(), fixed(r.real_time_factor, 2)].into_iter().chain(times).collect(),
        vec!["without contact of organs".to_owned(), fixed(r.real_time_factor_without_organ_contact, 2)],
    ];
    let line = format!(
        "a control period lasts {} ms; {} periods, {} organs, {} nodes, {} tets; the lift {}; {} threads on {}",
        fixed(r.period_ms, 1),
        r.periods,
        r.organs,
        count(r.nodes),
        count(r.tets),
        if r.attached { "held" } else { "did NOT hold" },
        r.threads,
        r.machine.described()
    );
    Document::new("Cell", "Speed of the two-arm cell")
        .with(Section::new("Control periods", "").table(Table::new(head, rows)).lines([line]))
}
