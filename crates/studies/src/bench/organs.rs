//! Speed and error of stepping organs: one schedule on one mesh.

use super::timing::Timing;
use crate::machine::Machine;
use crate::names::{SolverName, kilopascals};
use crate::scenes::{BenchScene, FRAME, OracleRun, Organs, Run, material, mean_error, rest_positions, rms_error};
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use trocar_core::Progress;
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed, percent};
use trocar_tissue::{Isa, Material};
use trocar_workflow::{check_interrupted, solver_named};

/// Frames of the tube scene at which the error is measured.
const TUBE_FRAMES: [usize; 3] = [15, 30, 60];

/// Maximum of `--settle` (s).
const MAX_SETTLE: f64 = 3600.0;

/// Speed and error of stepping six organs with one schedule.
#[derive(Clone, Debug, Args)]
pub struct OrgansBench {
    /// Gmsh file (.msh, in metres, z up) with the organs, one per physical group or connected part;
    /// our own organs by default.
    #[arg(long, value_name = "FILE", conflicts_with = "tets")]
    pub mesh: Option<PathBuf>,
    /// Approximate number of elements of our own organs.
    #[arg(long, default_value_t = 44_000)]
    pub tets: usize,
    /// The solver.
    #[arg(long, value_enum, default_value_t = SolverName::Fast)]
    pub schedule: SolverName,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Young's modulus (kPa).
    #[arg(long = "young", default_value = "12", value_parser = kilopascals)]
    pub young_modulus: f64,
    /// Poisson's ratio.
    #[arg(long = "poisson", default_value_t = 0.45)]
    pub poisson_ratio: f64,
    /// Damp the tissue as in the cell also in the timed scenes and the tube. The peers have no
    /// damping.
    #[arg(long)]
    pub damped: bool,
    /// Timed frames. A quarter as many warm-up frames come first.
    #[arg(long, default_value_t = 120)]
    pub frames: usize,
    /// Simulated time of settling before the sag is measured (s).
    #[arg(long, default_value_t = 3.0)]
    pub settle: f64,
    /// Also time the dragged appendix and the shaken organs by these instruction sets, frame beside
    /// frame, separated by commas: avx512, avx2, portable.
    #[arg(long = "isa", value_name = "SETS", value_delimiter = ',', value_parser = isa)]
    pub isas: Vec<Isa>,
}

/// The instruction set of that name.
fn isa(name: &str) -> std::result::Result<Isa, String> {
    let sets = [("avx512", Isa::Avx512), ("avx2", Isa::Avx2), ("portable", Isa::Portable)];
    let known = sets.into_iter().find(|(known, _)| *known == name);
    known.map(|(_, isa)| isa).ok_or_else(|| "the sets are avx512, avx2, portable".to_owned())
}

/// The timed scenes by one instruction set.
#[derive(Clone, Debug, Serialize)]
pub struct IsaRow {
    /// The instruction set.
    pub isa: &'static str,
    /// 1/60 s over the median wall time of a frame with the appendix dragged.
    pub real_time_factor: f64,
    /// The same with every organ shaken.
    pub real_time_factor_moving: f64,
    /// `real_time_factor` over that of the first row.
    pub over_first: f64,
    /// `real_time_factor_moving` over that of the first row.
    pub moving_over_first: f64,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct OrgansResult {
    /// 1/60 s over the median wall time of a frame, with a patch of the appendix dragged at 10
    /// mm/s.
    pub real_time_factor: f64,
    /// The same with a patch of every organ shaken.
    pub real_time_factor_moving: f64,
    /// The same while the organs sag from rest under gravity, as the peers are timed.
    pub real_time_factor_sag: f64,
    /// Median wall time of a frame with the appendix dragged (ms).
    pub frame_ms_median: f64,
    /// Mean distance of the settled nodes from the static equilibrium over their mean displacement
    /// by gravity.
    pub static_sag_error: f64,
    /// RMS distance from the oracle with the same substep over RMS displacement: the worst of
    /// frames 15, 30 and 60 of the tube.
    pub step_error: f64,
    /// Worker threads.
    pub threads: usize,
    /// Instruction set of the kernels.
    pub isa: &'static str,
    /// Name of the schedule.
    pub schedule: String,
    /// Substeps per frame.
    pub substeps: usize,
    /// Whether the tissue was damped in the timed scenes and the tube.
    pub damped: bool,
    /// Source of the organs.
    pub mesh: String,
    /// The timed scenes by each set of `--isa`, frame beside frame.
    pub rows: Vec<IsaRow>,
    /// Number of organs.
    pub organs: usize,
    /// Name of the organ used as the appendix.
    pub appendix: String,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements.
    pub tets: usize,
    /// Errors of the tube at frames 15, 30 and 60.
    pub step_errors: [f64; 3],
    /// Mean displacement of the free nodes by gravity in the static equilibrium (um).
    pub static_sag_um: f64,
    /// Simulated time of settling (s).
    pub settled_s: f64,
    /// Largest node speed after settling (m/s).
    pub settled_speed_m_s: f64,
    /// Frames with the appendix dragged.
    pub drag: Timing,
    /// Frames with every organ shaken.
    pub moving: Timing,
    /// Frames of the sag from rest.
    pub sagging: Timing,
    /// Largest number of inverted elements in the tube.
    pub tube_inverted: usize,
    /// Substeps in which the grasp of the tube yielded.
    pub tube_yielded_substeps: usize,
    /// The machine.
    pub machine: Machine,
}

impl Study for OrgansBench {
    const NAME: &'static str = "organs";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    type Figures = OrgansResult;

    fn run(&self, job: &Job<'_>) -> Result<(OrgansResult, Document)> {
        if self.frames == 0 || !(self.settle > 0.0 && self.settle <= MAX_SETTLE) {
            return Err(Error::Mismatch(format!(
                "--frames {} --settle {}: needs at least 1 frame and a time in (0, {MAX_SETTLE}] s",
                self.frames, self.settle
            )));
        }
        let machine = Machine::here();
        let progress = job.progress;
        let schedule = solver_named(self.schedule.name())?;
        let organs = match &self.mesh {
            Some(path) => Organs::read(path)?,
            None => Organs::analytic(self.tets)?,
        };
        let warm_up = self.frames / 4;
        let damped = material(self.young_modulus, self.poisson_ratio);
        let material = if self.damped { damped } else { Material { viscosity: 0.0, ..damped } };
        let time = |scene: &BenchScene| {
            progress.begin(scene.name, (warm_up + self.frames) as u64);
            let mut run = Run::new(scene, schedule, self.threads)?;
            let timing = Timing::of(&mut run, warm_up, self.frames, f64::INFINITY, progress);
            progress.end();
            timing
        };
        let drag = time(&BenchScene::drag(&organs, material)?)?;
        let moving = time(&BenchScene::moving(&organs, material)?)?;
        let sagging = time(&BenchScene::sag(&organs, material)?)?;

        let rows =
            self.by_isa(&BenchScene::drag(&organs, material)?, &BenchScene::moving(&organs, material)?, progress)?;

        let sag = BenchScene::sag(&organs, damped)?;
        let mut run = Run::new(&sag, schedule, self.threads)?;
        let frames = (self.settle / FRAME).round().max(1.0) as usize;
        progress.begin("sag", frames as u64 + 1);
        let mut settled_speed_m_s = 0.0;
        for _ in 0..frames {
            check_interrupted(progress)?;
            settled_speed_m_s = run.frame()?.max_speed;
            progress.advance(1);
        }
        let mut oracle = OracleRun::new(&sag);
        oracle.settle()?;
        progress.end();
        let (rest, truth) = (rest_positions(&sag.model), oracle.positions());
        let static_sag_error = mean_error(&run.positions(), &truth, &rest);
        let sags = rest.iter().zip(&truth).map(|(a, b)| a.distance(*b)).sum::<f64>();
        let free = sag.model.bodies().iter().flat_map(|b| b.pinned()).filter(|p| !**p).count();

        let tube = Tube::run(&BenchScene::tube(&organs, material)?, schedule, self.threads, progress)?;
        let result = OrgansResult {
            real_time_factor: drag.real_time_factor,
            real_time_factor_moving: moving.real_time_factor,
            real_time_factor_sag: sagging.real_time_factor,
            frame_ms_median: drag.frame_ms_median,
            static_sag_error,
            step_error: tube.errors.iter().copied().fold(0.0, f64::max),
            threads: if self.threads == 0 { machine.cores } else { self.threads },
            isa: schedule.isa(),
            schedule: self.schedule.name().to_owned(),
            damped: self.damped,
            substeps: schedule.substeps(),
            mesh: organs.source.clone(),
            rows,
            organs: organs.organs.len(),
            appendix: organs.organs[organs.appendix].name.clone(),
            nodes: organs.nodes(),
            tets: organs.tets(),
            step_errors: tube.errors,
            static_sag_um: 1e6 * sags / free.max(1) as f64,
            settled_s: frames as f64 * FRAME,
            settled_speed_m_s,
            drag,
            moving,
            sagging,
            tube_inverted: tube.inverted,
            tube_yielded_substeps: tube.yielded,
            machine,
        };
        let document = document(&result);
        Ok((result, document))
    }
}

impl OrgansBench {
    /// Times both scenes by each set of `--isa`.
    fn by_isa(&self, drag: &BenchScene, moving: &BenchScene, progress: &dyn Progress) -> Result<Vec<IsaRow>> {
        if self.isas.is_empty() {
            return Ok(Vec::new());
        }
        let (drag, moving) = (self.side_by_side(drag, progress)?, self.side_by_side(moving, progress)?);
        let row = |(k, isa): (usize, &Isa)| IsaRow {
            isa: isa.name(),
            real_time_factor: FRAME / drag[k],
            real_time_factor_moving: FRAME / moving[k],
            over_first: drag[0] / drag[k],
            moving_over_first: moving[0] / moving[k],
        };
        Ok(self.isas.iter().enumerate().map(row).collect())
    }

    /// Median wall time of a frame of a scene (s) by each set, which take turns frame by frame.
    fn side_by_side(&self, scene: &BenchScene, progress: &dyn Progress) -> Result<Vec<f64>> {
        let schedule = solver_named(self.schedule.name())?;
        let mut runs = Vec::new();
        for isa in &self.isas {
            if !isa.is_available() {
                return Err(Error::Mismatch(format!("--isa: this machine has no {}", isa.name())));
            }
            Isa::limit(*isa);
            runs.push((Run::new(scene, schedule, self.threads)?, Vec::with_capacity(self.frames)));
        }
        Isa::limit(Isa::ALL[0]);
        let warm_up = self.frames / 4;
        progress.begin(scene.name, (warm_up + self.frames) as u64);
        for frame in 0..warm_up + self.frames {
            check_interrupted(progress)?;
            for (run, times) in &mut runs {
                let began = Instant::now();
                run.frame()?;
                if frame >= warm_up {
                    times.push(began.elapsed().as_secs_f64());
                }
            }
            progress.advance(1);
        }
        progress.end();
        Ok(runs.iter_mut().map(|(_, times)| median(times)).collect())
    }
}

/// The tube scene, stepped beside the oracle.
struct Tube {
    errors: [f64; 3],
    inverted: usize,
    yielded: usize,
}

impl Tube {
    fn run(
        scene: &BenchScene,
        schedule: trocar_tissue::SolverSettings,
        threads: usize,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let substeps = schedule.substeps();
        let last = TUBE_FRAMES[TUBE_FRAMES.len() - 1];
        progress.begin("tube, oracle", (last * substeps) as u64);
        let mut run = Run::new(scene, schedule, threads)?;
        let mut oracle = OracleRun::new(scene);
        let rest = rest_positions(&scene.model);
        let mut tube = Self { errors: [f64::NAN; 3], inverted: 0, yielded: 0 };
        let h = FRAME / substeps as f64;
        for frame in 0..last {
            let report = run.frame()?;
            tube.inverted = tube.inverted.max(report.inverted);
            tube.yielded += report.grasp_limited;
            for substep in 0..substeps {
                check_interrupted(progress)?;
                oracle.step(h, frame as f64 * FRAME + (substep + 1) as f64 * h)?;
                progress.advance(1);
            }
            if let Some(k) = TUBE_FRAMES.iter().position(|f| *f == frame + 1) {
                tube.errors[k] = rms_error(&run.positions(), &oracle.positions(), &rest);
            }
        }
        progress.end();
        Ok(tube)
    }
}

fn document(r: &OrgansResult) -> Document {
    let rows = [
        (format!("{} dragged", r.appendix), &r.drag),
        ("every organ shaken".to_owned(), &r.moving),
        ("sag from rest".to_owned(), &r.sagging),
    ];
    let table = Table::of(
        rows,
        &[
            ("1/60 s frames", &|(name, _)| name.clone()),
            ("median (ms)", &|(_, t)| fixed(t.frame_ms_median, 2)),
            ("worst (ms)", &|(_, t)| fixed(t.frame_ms_worst, 2)),
            ("real time", &|(_, t)| format!("{}\u{d7}", fixed(t.real_time_factor, 2))),
            ("iterations", &|(_, t)| fixed(t.iterations_per_frame, 0)),
            ("inverted", &|(_, t)| count(t.inverted)),
            ("yielded", &|(_, t)| count(t.yielded_substeps)),
            ("fallbacks", &|(_, t)| count(t.fallbacks)),
        ],
    );
    let lines = [
        format!(
            "{}: {} organs, {} nodes, {} tets; schedule '{}' ({} substeps), {} threads on {}",
            r.mesh,
            r.organs,
            r.nodes,
            r.tets,
            r.schedule,
            r.substeps,
            r.threads,
            r.machine.described()
        ),
        format!(
            "sag error {} of the static solution (mean {} \u{b5}m) after {} s; largest node speed {:.1e} m/s",
            percent(r.static_sag_error, 3),
            fixed(r.static_sag_um, 2),
            fixed(r.settled_s, 1),
            r.settled_speed_m_s
        ),
        format!(
            "tube error {} against the oracle at frames 15, 30, 60; {} inverted, grasp yielded in {} substeps",
            r.step_errors.map(|e| percent(e, 3)).join(", "),
            r.tube_inverted,
            r.tube_yielded_substeps
        ),
    ];
    let mut section = Section::new("Six organs", "").table(table).lines(lines);
    if !r.rows.is_empty() {
        let times = |x: f64| format!("{}\u{d7}", fixed(x, 2));
        section = section.table(Table::of(
            &r.rows,
            &[
                ("instructions", &|row| row.isa.to_owned()),
                ("dragged, real time", &|row| times(row.real_time_factor)),
                ("over the first", &|row| fixed(row.over_first, 2)),
                ("shaken, real time", &|row| times(row.real_time_factor_moving)),
                ("over the first", &|row| fixed(row.moving_over_first, 2)),
            ],
        ));
    }
    Document::new("Organs", "Speed and error of stepping").with(section)
}
