//! Speed of stepping over the number of elements, over threads, and for many small models.

use super::many::{self, ManyRow};
use super::timing::Timing;
use crate::machine::Machine;
use crate::scenes::{BenchScene, Organs, Run, material};
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use trocar_core::Progress;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};
use trocar_workflow::{SOLVERS, solver_named};

/// Warm-up frames, and maximum number of timed frames.
const WARM_UP: usize = 3;
const FRAMES: usize = 60;

/// Minimum number of frames of a measurement, warm-up included.
const MIN_FRAMES: f64 = 6.0;

/// Speed of stepping from a thousand to a million elements, over threads, and of many small models.
#[derive(Clone, Debug, Args)]
pub struct ScalingBench {
    /// Target numbers of elements, ascending.
    #[arg(long, value_delimiter = ',', default_values_t = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000])]
    pub sizes: Vec<usize>,
    /// Numbers of worker threads.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2])]
    pub threads: Vec<usize>,
    /// Time limit of one measurement (s). Measurements that are expected to take longer are
    /// skipped.
    #[arg(long, default_value_t = 20.0)]
    pub budget: f64,
    /// Number of small models stepped in parallel; 0 for none.
    #[arg(long, default_value_t = 64)]
    pub many: usize,
    /// Approximate number of elements of each small model.
    #[arg(long, default_value_t = 700)]
    pub small: usize,
}

/// One size with one schedule and number of threads.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingRow {
    /// Name of the schedule.
    pub schedule: String,
    /// Instruction set of the kernels; empty if nothing was measured.
    pub isa: &'static str,
    /// Worker threads.
    pub threads: usize,
    /// Number of elements.
    pub tets: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Times; none if the measurement was skipped.
    pub timing: Option<Timing>,
    /// Why the measurement was skipped.
    pub skipped: Option<String>,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingResult {
    /// All sizes, schedules and numbers of threads.
    pub rows: Vec<ScalingRow>,
    /// Many small models beside one model.
    pub many: Vec<ManyRow>,
    /// The machine.
    pub machine: Machine,
}

impl Study for ScalingBench {
    const NAME: &'static str = "scaling";
    const KIND: Kind = Kind::Bench;
    type Figures = ScalingResult;

    fn run(&self, job: &Job<'_>) -> Result<(ScalingResult, Document)> {
        job.claim()?;
        let machine = Machine::here();
        let settings = SOLVERS.len() * self.threads.len();
        let mut rows: Vec<ScalingRow> = Vec::new();
        for size in &self.sizes {
            job.progress.begin(&format!("{size} tets"), (settings * (WARM_UP + FRAMES)) as u64);
            let made = Organs::analytic(*size)
                .and_then(|organs| Ok((BenchScene::moving(&organs, material(12e3, 0.45))?, organs)));
            for schedule in SOLVERS {
                for threads in &self.threads {
                    let row = match &made {
                        Ok((scene, organs)) => self.row(scene, organs, schedule, *threads, &rows, job.progress)?,
                        Err(why) => blank(schedule, *threads, *size, why.to_string()),
                    };
                    rows.push(row);
                }
            }
            job.progress.end();
        }
        let many = match self.many {
            0 => Vec::new(),
            count => many::measure(count, self.small, &self.threads, self.budget, job.progress)?,
        };
        let result = ScalingResult { rows, many, machine };
        let document = document(&result)?;
        Ok((result, document))
    }
}

impl ScalingBench {
    fn row(
        &self,
        scene: &BenchScene,
        organs: &Organs,
        schedule: &str,
        threads: usize,
        before: &[ScalingRow],
        progress: &dyn Progress,
    ) -> Result<ScalingRow> {
        let (tets, nodes) = (organs.tets(), organs.nodes());
        let expected = expected_seconds(before, schedule, threads, tets);
        if expected > self.budget {
            let why = format!("{expected:.0} s expected, {:.0} s allowed", self.budget);
            return Ok(ScalingRow { nodes, ..blank(schedule, threads, tets, why) });
        }
        let timed = Run::new(scene, solver_named(schedule)?, threads)
            .and_then(|mut run| Timing::of(&mut run, WARM_UP, FRAMES, self.budget, progress));
        let (timing, skipped) = match timed {
            Ok(timing) => (Some(timing), None),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => (None, Some(why.to_string())),
        };
        let (schedule, isa) = (schedule.to_owned(), solver_named(schedule)?.isa());
        Ok(ScalingRow { schedule, isa, threads, tets, nodes, timing, skipped })
    }
}

/// Expected time of a minimal measurement (s): in proportion to the largest size measured so far; 0
/// for the first size.
fn expected_seconds(before: &[ScalingRow], schedule: &str, threads: usize, tets: usize) -> f64 {
    let same = before.iter().filter(|r| r.schedule == schedule && r.threads == threads);
    let largest = same.filter_map(|r| Some((r.tets, r.timing.as_ref()?.frame_ms_median))).max_by_key(|r| r.0);
    largest.map_or(0.0, |(size, ms)| 1e-3 * ms * MIN_FRAMES * tets as f64 / size.max(1) as f64)
}

fn blank(schedule: &str, threads: usize, tets: usize, why: String) -> ScalingRow {
    ScalingRow { schedule: schedule.to_owned(), isa: "", threads, tets, nodes: 0, timing: None, skipped: Some(why) }
}

/// Maximum loss of many small models.
const MAX_LOSS: f64 = 0.1;

fn document(result: &ScalingResult) -> Result<Document> {
    let m = &result.machine;
    let load = m.load.map_or(String::new(), |l| {
        let busy = if l > 0.5 { "; the machine was not idle: the figures are too low" } else { "" };
        format!(", load {} at the start{busy}", fixed(l, 1))
    });
    let lead = format!(
        "Our own six organs (fewer at the smallest sizes), the lowest 42% of each pinned and a patch of each shaken. \
         Median of up to 60 frames of \
         1/60 s; {} cores{load}. The dashed line is real time.",
        m.cores
    );
    let plots = [
        plot(result, "Real-time factor", "times real time", &|r, t| (r.tets as f64, t.real_time_factor))?,
        plot(result, "Time per element", "\u{b5}s per frame", &|r, t| {
            (r.tets as f64, 1e3 * t.frame_ms_median / r.tets as f64)
        })?,
    ];
    let mut document = Document::new("Scaling", "Stepping over elements, threads and models")
        .with(Section::new("Sizes", lead).figures(plots).table(sizes(result)));
    if !result.many.is_empty() {
        let section = Section::new(
            "Many small models",
            "Each small model is an appendix with its own stepper; the models are divided among the threads. For \
             comparison: one model with the same appendixes, and \
             six organs of the same total size.",
        );
        document = document.with(section.cards(cards(result)).table(many_table(result)));
    }
    Ok(document)
}

/// Schedules and numbers of threads in the order of the rows.
fn settings(result: &ScalingResult) -> Vec<(&str, usize)> {
    let mut all: Vec<(&str, usize)> = Vec::new();
    for row in &result.rows {
        if !all.contains(&(row.schedule.as_str(), row.threads)) {
            all.push((&row.schedule, row.threads));
        }
    }
    all
}

fn plot(
    result: &ScalingResult,
    title: &'static str,
    y: &'static str,
    point: &dyn Fn(&ScalingRow, &Timing) -> (f64, f64),
) -> Result<String> {
    let settings = settings(result);
    let line = |(k, (schedule, threads)): (usize, &(&str, usize))| {
        let rows = result.rows.iter().filter(|r| (r.schedule.as_str(), r.threads) == (schedule, *threads));
        let points = rows.filter_map(|r| r.timing.as_ref().map(|t| point(r, t))).collect();
        Line::new(points, colors::organ(k))
    };
    let lines = settings.iter().enumerate().map(line).collect();
    let limits = if title == "Real-time factor" { vec![1.0] } else { vec![] };
    let plot = Plot { title, x: "elements", y, lines, limits, log_x: true, log_y: true, ..Plot::default() };
    let names: Vec<String> = settings.iter().map(|(s, t)| format!("{s}, {}", threads(*t))).collect();
    let legend = page::legend(names.iter().enumerate().map(|(k, name)| (name.as_str(), colors::organ(k))));
    Ok(plot.figure(&format!("<b>{title}.</b>{legend}"))?)
}

fn threads(n: usize) -> String {
    if n == 1 { "1 thread".to_owned() } else { format!("{n} threads") }
}

fn sizes(result: &ScalingResult) -> Table {
    let head = [
        "Schedule",
        "Kernels",
        "Threads",
        "Elements",
        "Nodes",
        "Frame (ms)",
        "Real time",
        "Iterations per frame",
        "Inverted",
        "Yielded",
    ];
    let row = |r: &ScalingRow| {
        let mut cells =
            vec![r.schedule.clone(), r.isa.to_owned(), r.threads.to_string(), count(r.tets), count(r.nodes)];
        match (&r.timing, &r.skipped) {
            (Some(t), _) => cells.extend([
                fixed(t.frame_ms_median, 2),
                format!("{}\u{d7}", fixed(t.real_time_factor, 2)),
                fixed(t.iterations_per_frame, 0),
                count(t.inverted),
                count(t.yielded_substeps),
            ]),
            (None, why) => cells.push(why.clone().unwrap_or_default()),
        }
        cells
    };
    Table::new(head, result.rows.iter().map(row).collect())
}

fn cards(result: &ScalingResult) -> Vec<Card> {
    let card = |r: &ManyRow| {
        let note =
            format!("{} models, {}, {}; at most {}", r.models, r.schedule, threads(r.threads), percent(MAX_LOSS, 0));
        Card::new("Loss against one model", percent(r.loss, 1), note).met(r.loss <= MAX_LOSS)
    };
    result.many.iter().map(card).collect()
}

fn many_table(result: &ScalingResult) -> Table {
    Table::of(
        &result.many,
        &[
            ("Schedule", &|r| r.schedule.clone()),
            ("Threads", &|r| r.threads.to_string()),
            ("Models", &|r| r.models.to_string()),
            ("Elements", &|r| count(r.tets)),
            ("Many (ms)", &|r| fixed(r.many_ms, 2)),
            ("One model (ms)", &|r| fixed(r.one_model_ms, 2)),
            ("Loss", &|r| percent(r.loss, 1)),
            ("Six organs (ms)", &|r| fixed(r.organs_ms, 2)),
            ("Elements of organs", &|r| count(r.organs_tets)),
            ("Loss per element", &|r| percent(r.loss_against_organs, 1)),
        ],
    )
}
