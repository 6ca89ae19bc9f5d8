//! How stepping scales: with the number of elements, with threads, and with many small models beside one of the same size.

use super::machine::Machine;
use super::many::{self, ManyRow};
use super::timing::Timing;
use crate::{Error, Result, pages};
use serde::Serialize;
use std::path::Path;
use trocar_core::Progress;
use trocar_specimen::StagedFolder;
use trocar_testing::scenes::{Organs, Run, Scene, material};
use trocar_workflow::REPORT;
use trocar_workflow::{SOLVERS, solver_named};

/// The file that makes a folder one of this benchmark's.
const MARKER: &str = "scaling.json";

/// Frames before the timed ones, and most timed ones.
const WARM_UP: usize = 3;
const FRAMES: usize = 60;

/// Frames that a measurement has at least, warm-up included.
const LEAST_FRAMES: f64 = 6.0;

/// The benchmark's options.
#[derive(Clone, Debug)]
pub struct ScalingBench {
    /// Elements of our own organs together, about; ascending.
    pub sizes: Vec<usize>,
    /// Numbers of worker threads.
    pub threads: Vec<usize>,
    /// Wall time that one measurement may take [s]: what is expected to take longer is left out, and said.
    pub budget: f64,
    /// Small models stepped at once; 0: none.
    pub many: usize,
    /// Elements of each of them, about.
    pub small: usize,
}

impl Default for ScalingBench {
    fn default() -> Self {
        Self {
            sizes: vec![1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
            threads: vec![1, 2],
            budget: 20.0,
            many: 64,
            small: 700,
        }
    }
}

/// One size with one schedule and number of threads.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingRow {
    /// The schedule's name.
    pub schedule: String,
    /// Instruction set of its kernels; empty where nothing was measured.
    pub isa: &'static str,
    /// Worker threads.
    pub threads: usize,
    /// Elements.
    pub tets: usize,
    /// Nodes.
    pub nodes: usize,
    /// The frames; none where there is a reason.
    pub timing: Option<Timing>,
    /// Why it was not measured.
    pub skipped: Option<String>,
}

/// The benchmark's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ScalingResult {
    /// Every size, schedule and number of threads.
    pub rows: Vec<ScalingRow>,
    /// Many small models beside one.
    pub many: Vec<ManyRow>,
    /// The machine.
    pub machine: Machine,
    /// The report's path.
    pub report: String,
}

impl ScalingBench {
    /// Runs everything and writes the report into the folder `output`.
    ///
    /// # Errors
    /// A folder that cannot be written, an interruption. What cannot be measured is a row that says why.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ScalingResult> {
        let staged = StagedFolder::create(output, MARKER)?;
        let machine = Machine::here();
        let settings = SOLVERS.len() * self.threads.len();
        let mut rows: Vec<ScalingRow> = Vec::new();
        for size in &self.sizes {
            progress.begin(&format!("{size} tets"), (settings * (WARM_UP + FRAMES)) as u64);
            let made =
                Organs::analytic(*size).and_then(|organs| Ok((Scene::moving(&organs, material(12e3, 0.45))?, organs)));
            for schedule in SOLVERS {
                for threads in &self.threads {
                    let row = match &made {
                        Ok((scene, organs)) => self.row(scene, organs, schedule, *threads, &rows, progress)?,
                        Err(why) => blank(schedule, *threads, *size, why.to_string()),
                    };
                    rows.push(row);
                }
            }
            progress.end();
        }
        let many = match self.many {
            0 => Vec::new(),
            count => many::measure(count, self.small, &self.threads, self.budget, progress)?,
        };
        let result = ScalingResult { rows, many, machine, report: output.join(REPORT).display().to_string() };
        let html = pages::scaling(&result)?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        for (name, bytes) in [(REPORT, html.into_bytes()), (MARKER, json)] {
            let path = staged.path().join(name);
            std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })?;
        }
        staged.commit()?;
        Ok(result)
    }

    fn row(
        &self,
        scene: &Scene,
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
            .map_err(Error::from)
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

/// What the fewest frames are expected to take [s], from the largest size measured so far, in proportion; not known, and so 0, for the first.
fn expected_seconds(before: &[ScalingRow], schedule: &str, threads: usize, tets: usize) -> f64 {
    let same = before.iter().filter(|r| r.schedule == schedule && r.threads == threads);
    let largest = same.filter_map(|r| Some((r.tets, r.timing.as_ref()?.frame_ms_median))).max_by_key(|r| r.0);
    largest.map_or(0.0, |(size, ms)| 1e-3 * ms * LEAST_FRAMES * tets as f64 / size.max(1) as f64)
}

fn blank(schedule: &str, threads: usize, tets: usize, why: String) -> ScalingRow {
    ScalingRow { schedule: schedule.to_owned(), isa: "", threads, tets, nodes: 0, timing: None, skipped: Some(why) }
}
