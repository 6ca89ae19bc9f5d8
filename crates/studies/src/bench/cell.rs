//! Speed of a whole cell: two arms, two instruments, all organs in motion, no cameras.
//!
//! The left arm performs the scripted grasp-lift; the right arm swings in its port. A second cell
//! without contact between organs gets the same actions, alternating with the first. The difference
//! is the cost of that contact.

use crate::Result;
use crate::machine::{Machine, Setup};
use crate::names::SceneChoice;
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use trocar_cell::{Action, Cell, ContactParts, Setpoint};
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::fixed;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::policy::{Script, Scripted};
use trocar_task::{Episode, Policy, SETTLE_S};
use trocar_workflow::specimen_scene::{grasp_lift, task_organ};
use trocar_workflow::{check_interrupted, scene_specimen};

/// Swing of the right arm: amplitude of the pivots (rad), frequency (Hz).
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

/// Figures of the benchmark. Times are means over control periods (ms of wall time).
#[derive(Clone, Debug, Serialize)]
pub struct CellBenchResult {
    /// Simulated over wall time of the whole cell, after settling.
    pub real_time_factor: f64,
    /// The same without contact between organs.
    pub real_time_factor_without_organ_contact: f64,
    /// Controllers, ports and dynamics of the arms (ms).
    pub arms_ms: f64,
    /// Contact between organs: tissue with it minus tissue without it (ms).
    pub contact_ms: f64,
    /// Tissue without that contact: elasticity, supports, contact with instruments, grasp (ms).
    pub tissue_ms: f64,
    /// The rest: jaws, grasp detection, observations (ms).
    pub rest_ms: f64,
    /// Median of a control period (ms).
    pub median_ms: f64,
    /// Slowest control period (ms).
    pub worst_ms: f64,
    /// Simulated length of a control period (ms).
    pub period_ms: f64,
    /// Number of timed control periods.
    pub periods: usize,
    /// Whether the grasper held the tissue at the end.
    pub attached: bool,
    /// What was stepped, and on what.
    #[serde(flatten)]
    pub setup: Setup,
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
        lifting.variation = trocar_scene::Variation::default();
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
                check_interrupted(progress)?;
                if let Some(right) = &right {
                    swing(&mut action, right, episode.time());
                }
                let before = episode.cell().timing().all;
                // The order alternates: disturbances of the machine affect both.
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
            setup: Setup::new(&cell.world().model, self.threads, machine),
        };
        let document = document(&result);
        Ok((result, document))
    }
}

/// Sets the two pivots of the right arm, which are entries 5 and 6 of an action.
fn swing(action: &mut Action, at: &Setpoint, time: f64) {
    let phase = std::f64::consts::TAU * SWING.1 * time;
    // Upwards from the start, away from the tissue, and back.
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
        "organ contact (ms)",
        "tissue (ms)",
        "rest (ms)",
        "median (ms)",
        "worst (ms)",
    ];
    let times = [r.arms_ms, r.contact_ms, r.tissue_ms, r.rest_ms, r.median_ms, r.worst_ms].map(|ms| fixed(ms, 2));
    let rows = vec![
        ["whole cell".to_owned(), fixed(r.real_time_factor, 2)].into_iter().chain(times).collect(),
        vec!["without contact between organs".to_owned(), fixed(r.real_time_factor_without_organ_contact, 2)],
    ];
    let line = format!(
        "control period {} ms; {} periods; the lift {}; {}",
        fixed(r.period_ms, 1),
        r.periods,
        if r.attached { "held" } else { "did NOT hold" },
        r.setup.described()
    );
    Document::new("Cell", "Speed of the two-arm cell")
        .with(Section::new("Control periods", "").table(Table::new(head, rows)).lines([line]))
}
