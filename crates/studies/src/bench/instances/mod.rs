//! Many instances of one lattice in SIMD lanes, beside the fastest way to step one alone.

mod alone;
#[cfg(feature = "gpu")]
mod card;
mod page;
mod scene;

use crate::machine::Machine;
use crate::scenes::rms_error;
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use alone::Alone;
use clap::Args;
use glam::DVec3;
use scene::{FILL, GRIP, Scene};
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_tissue::{Batch, BatchSettings, Instance, Isa, ToolMotion};
use trocar_workflow::check_interrupted;

/// Frames before the timed ones.
const WARM_UP: usize = 4;

/// Maximum of `--instances` and of `--nodes`.
const MAX_INSTANCES: usize = 100_000;
const MAX_NODES: usize = 50_000;

/// Many instances of one lattice stepped together, an instance in each SIMD lane.
#[derive(Clone, Debug, Args)]
pub struct ManyBench {
    /// Numbers of instances.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 16, 64, 256, 1_024])]
    pub instances: Vec<usize>,
    /// Approximate numbers of nodes of the lattice.
    #[arg(long, value_delimiter = ',', default_values_t = [500, 2_000])]
    pub nodes: Vec<usize>,
    /// Substeps of a frame of 1/60 s, of the batch and of those alone.
    #[arg(long, default_value_t = 2)]
    pub substeps: usize,
    /// Timed frames of each number of instances.
    #[arg(long, default_value_t = 20)]
    pub frames: usize,
    /// Frames after which errors are taken.
    #[arg(long, default_value_t = 15)]
    pub judged_frames: usize,
    /// Instances whose errors are taken, the first ones.
    #[arg(long, default_value_t = 3)]
    pub judged: usize,
    /// Relative tolerance of the batch.
    #[arg(long, default_value_t = BatchSettings::default().relative)]
    pub relative: f64,
    /// Stiffness of the empty parts of boundary cells over the tissue's, 0.001 to 0.1.
    #[arg(long, default_value_t = FILL)]
    pub fill: f64,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Step them on a graphics card too. Needs a build with the feature `gpu`.
    #[arg(long)]
    pub gpu: bool,
}

/// One number of instances of one lattice.
#[derive(Clone, Debug, Serialize)]
pub struct InstancesRow {
    /// Number of instances.
    pub instances: usize,
    /// Nodes of the lattice.
    pub nodes: usize,
    /// Frames of the whole batch a second, by the median.
    pub frames_per_s: f64,
    /// Frames of one organ a second.
    pub organ_frames_per_s: f64,
    /// RMS distance from the converged solution of the same substeps over RMS displacement, the
    /// worst of the judged instances.
    pub error: f64,
    /// Memory of the batch, with the scratch of its threads (MB).
    pub memory_mb: f64,
    /// How many times cheaper an instance is than the fastest way to step one alone that is no less
    /// accurate, on as many threads.
    pub over_alone: f64,
    /// Name of this way.
    pub alone: &'static str,
    /// Its error.
    pub alone_error: f64,
    /// Its time of a frame, in turn with the batch's (ms).
    pub alone_ms: f64,
    /// Rounds of a substep's search.
    pub rounds: f64,
    /// Substeps whose search did not end within its tolerance.
    pub unconverged: usize,
}

/// The same instances on a graphics card.
#[derive(Clone, Debug, Serialize)]
pub struct CardRow {
    /// Name of the card.
    pub card: String,
    /// Number of instances.
    pub instances: usize,
    /// Nodes of the lattice.
    pub nodes: usize,
    /// Frames of the whole batch a second, by the median. Paths of the tools go to the card and
    /// reports come back in each.
    pub frames_per_s: f64,
    /// Frames of one organ a second.
    pub organ_frames_per_s: f64,
    /// Times the rate of the lanes in the same run.
    pub over_lanes: f64,
    /// RMS distance from the converged solution of the same substeps over RMS displacement, the
    /// worst of the judged instances.
    pub error: f64,
    /// Memory on the card (MB).
    pub memory_mb: f64,
    /// Rounds of a substep's search.
    pub rounds: f64,
    /// Substeps whose search did not end within its tolerance.
    pub unconverged: usize,
}

/// World positions of an instance's points in the converged solution, and at rest (m).
type Truth = [Vec<DVec3>; 2];

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct ManyResult {
    /// All numbers of instances and nodes.
    pub rows: Vec<InstancesRow>,
    /// The ways to step one alone, for each number of nodes.
    pub alone: Vec<Alone>,
    /// The same on a graphics card, with `--gpu`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub card: Vec<CardRow>,
    /// Worker threads.
    pub threads: usize,
    /// Substeps of a frame.
    pub substeps: usize,
    /// Instruction set of the kernels.
    pub isa: &'static str,
    /// The machine.
    pub machine: Machine,
}

impl Study for ManyBench {
    const NAME: &'static str = "many";
    const KIND: Kind = Kind::Bench;
    type Figures = ManyResult;

    fn run(&self, job: &Job<'_>) -> Result<(ManyResult, Document)> {
        self.check()?;
        job.claim()?;
        let machine = Machine::here();
        let (mut rows, mut alone, mut card) = (Vec::new(), Vec::new(), Vec::new());
        for nodes in &self.nodes {
            let scene = Scene::new(*nodes, self.fill)?;
            let truths = self.truths(&scene, job.progress)?;
            let errors = self.errors(&scene, &truths)?;
            let ways = alone::errors(&scene, self.judged_frames, self.substeps, || check_interrupted(job.progress))?;
            for count in &self.instances {
                let row = self.row(&scene, *count, (&errors, &ways), job.progress)?;
                if self.gpu {
                    card.push(self.card_row(&scene, &row, &truths, job.progress)?);
                }
                rows.push(row);
            }
            alone.extend(ways);
        }
        let threads = if self.threads == 0 { machine.cores } else { self.threads };
        let result =
            ManyResult { rows, alone, card, threads, substeps: self.substeps, isa: Isa::detect().name(), machine };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl ManyBench {
    fn check(&self) -> Result<()> {
        let within =
            |values: &[usize], most: usize| !values.is_empty() && values.iter().all(|value| (1..=most).contains(value));
        if !within(&self.instances, MAX_INSTANCES) || !within(&self.nodes, MAX_NODES) {
            return Err(Error::Mismatch(format!(
                "--instances {:?} --nodes {:?}: each must be at least 1, instances at most {MAX_INSTANCES} and nodes \
                 at most {MAX_NODES}",
                self.instances, self.nodes
            )));
        }
        if self.frames == 0 || self.judged == 0 || self.judged_frames == 0 {
            return Err(Error::Mismatch(format!(
                "--frames {} --judged {} --judged-frames {}: each must be at least 1",
                self.frames, self.judged, self.judged_frames
            )));
        }
        if !(1e-3..=0.1).contains(&self.fill) {
            return Err(Error::Mismatch(format!("--fill {}: must be in [0.001, 0.1]", self.fill)));
        }
        if self.gpu && !cfg!(feature = "gpu") {
            let reason = "--gpu: this build cannot use a graphics card; build it with `--features gpu`";
            return Err(Error::Mismatch(reason.to_owned()));
        }
        Ok(())
    }

    #[cfg(not(feature = "gpu"))]
    fn card_row(&self, _: &Scene, _: &InstancesRow, _: &[Truth], _: &dyn Progress) -> Result<CardRow> {
        Err(Error::Mismatch("--gpu: this build cannot use a graphics card".to_owned()))
    }

    fn settings(&self) -> BatchSettings {
        BatchSettings { substeps: self.substeps, relative: self.relative, ..BatchSettings::default() }
    }

    /// A batch whose jaws have closed.
    fn batch(&self, scene: &Scene, count: usize) -> Result<Batch> {
        let own: Vec<Instance> = (0..count).map(|k| scene.instance(k)).collect();
        let mut batch = Batch::new(&scene.body, &own, self.settings(), self.threads).map_err(of_tissue)?;
        for k in 0..count {
            batch.grasp(k, &scene.grip, GRIP, &scene.tool_at(k, 0.0)).map_err(of_tissue)?;
        }
        Ok(batch)
    }

    /// The converged solution of the first instances.
    fn truths(&self, scene: &Scene, progress: &dyn Progress) -> Result<Vec<Truth>> {
        let judged = self.judged.min(self.instances.iter().copied().max().unwrap_or(1));
        progress.begin("converged instances", judged as u64);
        let truth = |k: usize| {
            let stop = || check_interrupted(progress);
            let truth = scene.converged(k, self.judged_frames, self.substeps, stop)?;
            progress.advance(1);
            Ok(truth)
        };
        let truths = (0..judged).map(truth).collect::<Result<_>>()?;
        progress.end();
        Ok(truths)
    }

    /// Errors of the first instances. They do not depend on the number of instances.
    fn errors(&self, scene: &Scene, truths: &[Truth]) -> Result<Vec<f64>> {
        let mut batch = self.batch(scene, truths.len())?;
        for frame in 0..self.judged_frames {
            let tools: Vec<ToolMotion> = (0..truths.len()).map(|k| scene.tool(k, frame)).collect();
            batch.step(&tools).map_err(of_tissue)?;
        }
        Ok(errors_of(&batch, scene, truths))
    }

    /// Times a number of instances in turn with those alone.
    fn row(
        &self,
        scene: &Scene,
        count: usize,
        (errors, ways): (&[f64], &[Alone]),
        progress: &dyn Progress,
    ) -> Result<InstancesRow> {
        let whole = WARM_UP + self.frames;
        progress.begin(&format!("{count} instances of {} nodes", scene.nodes()), whole as u64);
        let mut batch = self.batch(scene, count)?;
        let mut alone = alone::runs(scene, self.substeps)?;
        let (mut times, mut others) = (Vec::new(), vec![Vec::new(); ways.len()]);
        let (mut rounds, mut unconverged) = (0, 0);
        for frame in 0..whole {
            check_interrupted(progress)?;
            let tools: Vec<ToolMotion> = (0..count).map(|k| scene.tool(k, frame)).collect();
            let clock = Instant::now();
            let reports = batch.step(&tools).map_err(of_tissue)?;
            let took = clock.elapsed().as_secs_f64();
            if frame >= WARM_UP {
                times.push(took);
            }
            for (run, times) in alone.iter_mut().zip(&mut others) {
                let clock = Instant::now();
                run.frame()?;
                if frame >= WARM_UP {
                    times.push(clock.elapsed().as_secs_f64());
                }
            }
            if frame >= WARM_UP {
                rounds += reports.iter().map(|r| r.rounds).sum::<usize>();
                unconverged += reports.iter().map(|r| r.unconverged).sum::<usize>();
            }
            progress.advance(1);
        }
        progress.end();
        let frame = median(&mut times);
        let error = errors.iter().copied().take(count).fold(0.0, f64::max);
        let others: Vec<f64> = others.iter_mut().map(|times| median(times)).collect();
        // The fastest of those that are no less accurate; of all if there is none.
        let accurate = |way: &usize| ways[*way].error <= error;
        let by_time = |a: &usize, b: &usize| others[*a].total_cmp(&others[*b]);
        let fastest = (0..ways.len()).filter(accurate).min_by(by_time).or((0..ways.len()).min_by(by_time)).unwrap_or(0);
        let threads = if self.threads == 0 { Machine::here().cores } else { self.threads };
        // Those alone could be stepped on as many threads as the batch.
        let at_once = threads.min(count).max(1) as f64;
        Ok(InstancesRow {
            instances: count,
            nodes: scene.nodes(),
            frames_per_s: 1.0 / frame,
            organ_frames_per_s: count as f64 / frame,
            error,
            memory_mb: batch.bytes() as f64 / 1e6,
            over_alone: count as f64 * others[fastest] / at_once / frame,
            alone: ways[fastest].name,
            alone_error: ways[fastest].error,
            alone_ms: 1e3 * others[fastest],
            rounds: rounds as f64 / (count * self.frames * self.substeps) as f64,
            unconverged,
        })
    }
}

/// Errors of the first instances of a batch.
fn errors_of(batch: &Batch, scene: &Scene, truths: &[Truth]) -> Vec<f64> {
    let error = |(k, [truth, rest]): (usize, &Truth)| {
        let own: Vec<DVec3> = scene.points.iter().map(|point| batch.point(k, point)).collect();
        rms_error(&own, truth, rest)
    };
    truths.iter().enumerate().map(error).collect()
}

/// An error of the tissue, as one of a study.
fn of_tissue(error: trocar_tissue::Error) -> Error {
    Error::Study(error.into())
}
