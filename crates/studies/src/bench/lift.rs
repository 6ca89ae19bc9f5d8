//! Cost of a whole organ in the jaws: the grasp-lift of one organ, from the first contact of the
//! jaws to their release, beside a frame of *drag* of six organs with as many elements.

use super::timing::Timing;
use crate::machine::Machine;
use crate::names::Units;
use crate::scenes::{BenchScene, FRAME, Organ, Organs, Run, ellipsoid, material};
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use crate::trials::{Outcomes, Resumed, resumed};
use crate::{Error, Result};
use clap::Args;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_geometry::io::{Unit, write_ply};
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed};
use trocar_specimen::Specimen;
use trocar_task::policy::Scripted;
use trocar_task::{Episode, Policy};
use trocar_workflow::specimen_scene::{free_scene, task_organ};
use trocar_workflow::{Lift, check_interrupted, reconstruct_surface, solver_named};

/// Real organs, beside the repository, in millimetres.
const DATA: &str = "../shared/data";
const REAL: [&str; 10] = [
    "openhelp/Liver.stl",
    "openhelp/Stomach.stl",
    "openhelp/Spleen.stl",
    "openhelp/Kidney_left.stl",
    "openhelp/Duodenum.stl",
    "openhelp/Bladder_half.stl",
    "lapgym_organs/grasp_lift_touch__gallbladder_visual.stl",
    "lapgym_organs/grasp_lift_touch__gallbladder_collision.stl",
    "lapgym_organs/grasp_lift_touch__liver_visual.stl",
    "lapgym_organs/grasp_lift_touch__liver_collision.stl",
];

/// Our own organ: its name, and the half axes of an ellipsoid of a kidney's size (m).
const OWN: (&str, [f64; 3]) = ("our own", [0.055, 0.030, 0.022]);

/// Edge of the triangles of its surface (m).
const SPACING: f64 = 2e-3;

/// The phases in which jaws touch tissue.
const PHASES: [&str; 6] = ["approach", "enter", "close", "lift", "hold", "lower"];

/// Force from which jaws touch tissue (N).
const TOUCH_N: f64 = 1e-3;

/// Frames of *drag*: warm-up, and timed.
const WARM_UP: usize = 30;
const DRAG_FRAMES: usize = 120;

/// Cost of one whole organ in the jaws: a grasp-lift of each organ, from the first contact of the
/// jaws to their release, beside the drag of six organs with as many elements.
#[derive(Clone, Debug, Args)]
pub struct LiftBench {
    /// Surfaces of organs (STL, OBJ or PLY). By default one of our own, and the real ones in
    /// ../shared/data where they are.
    #[arg(long = "surface", value_name = "FILES", num_args = 1..)]
    pub surfaces: Vec<PathBuf>,
    /// Unit of the surfaces.
    #[arg(long, value_enum, default_value_t = Units::Mm)]
    pub units: Units,
    /// Worker threads; all by default. Each organ is also lifted on one thread.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// Rounds of lifts and drags. The time of a frame is its median over the rounds, since the same
    /// frame is the same work.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=99))]
    pub rounds: u32,
}

/// Times of a phase.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhaseTiming {
    /// Name of the phase.
    pub phase: String,
    /// Frames.
    pub frames: usize,
    /// Mean wall time of a frame (ms), each frame the median of its rounds.
    pub ms_per_frame: f64,
    /// The slowest such frame (ms).
    pub worst_ms: f64,
    /// Mean iterations of the solver in a frame, over all substeps.
    pub iterations_per_frame: f64,
}

/// One organ.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LiftRow {
    /// Name of the organ.
    pub organ: String,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub elements: usize,
    /// Frames from the first contact of the jaws to their release.
    pub frames: usize,
    /// Mean wall time of such a frame (ms), each the median of its rounds.
    pub ms_per_frame_mean: f64,
    /// Its 95th percentile (ms).
    pub ms_per_frame_p95: f64,
    /// The same lift on one thread, mean (ms).
    pub one_thread_ms_per_frame: f64,
    /// A frame of *drag* of this organ alone, mean (ms).
    pub own_drag_ms_per_frame: f64,
    /// A frame of *drag* of six organs with as many elements in all, mean (ms).
    pub six_drag_ms_per_frame: f64,
    /// `ms_per_frame_mean` over `six_drag_ms_per_frame`.
    pub lift_over_six: f64,
    /// `ms_per_frame_p95` over `six_drag_ms_per_frame`.
    pub lift_over_six_p95: f64,
    /// `ms_per_frame_mean` over `own_drag_ms_per_frame`.
    pub lift_over_own_drag: f64,
    /// `one_thread_ms_per_frame` over `ms_per_frame_mean`.
    pub two_threads_over_one: f64,
    /// 1/60 s over `ms_per_frame_mean`.
    pub real_time_factor: f64,
    /// Whether the lift held the organ.
    pub held: bool,
    /// The phases, in the order of the script.
    pub phases: Vec<PhaseTiming>,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct LiftResult {
    /// The organs.
    pub rows: Vec<LiftRow>,
    /// Worker threads.
    pub threads: usize,
    /// What was left out, and why.
    pub skipped: Vec<String>,
    /// The machine.
    pub machine: Machine,
    /// Organs of an earlier run on this machine.
    pub resumed: Resumed,
}

/// A surface file.
struct Surface {
    name: String,
    path: PathBuf,
    unit: Unit,
}

/// A timed frame.
struct Frame {
    phase: &'static str,
    ms: f64,
    iterations: usize,
}

impl Study for LiftBench {
    const NAME: &'static str = "lift";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> =
        Some("Folder of the report and of the organs' specimens. Finished organs in it are used again.");
    type Figures = LiftResult;

    fn run(&self, job: &Job<'_>) -> Result<(LiftResult, Document)> {
        let machine = Machine::here();
        job.claim()?;
        let (surfaces, skipped) = self.surfaces(job)?;
        let threads = if self.threads == 0 { machine.cores } else { self.threads };
        let settings = format!("{threads} {} {:?} {}", self.rounds, self.units, machine.name());
        let key = |surface: &Surface| surface.path.display().to_string();
        let Outcomes { rows, resumed } =
            job.trials("organs", &settings, &surfaces, key, 1, |Surface { name, path, unit }, progress| {
                let folder = job.output().join("specimens").join(name);
                if !folder.is_dir() {
                    reconstruct_surface(path, *unit, &Default::default(), &folder, progress)?;
                }
                row(name, &Specimen::read(&folder)?, &folder, (threads, self.rounds), progress)
            })?;
        let result = LiftResult { rows, threads, skipped, machine, resumed };
        let document = document(&result);
        Ok((result, document))
    }
}

impl LiftBench {
    /// The surfaces with their names and units, and what is left out.
    fn surfaces(&self, job: &Job<'_>) -> Result<(Vec<Surface>, Vec<String>)> {
        let named = |path: &Path, unit: Unit| {
            let name = path.file_stem().map_or_else(|| "organ".to_owned(), |n| n.to_string_lossy().into_owned());
            Surface { name, path: path.to_owned(), unit }
        };
        if !self.surfaces.is_empty() {
            return Ok((self.surfaces.iter().map(|path| named(path, self.units.into())).collect(), Vec::new()));
        }
        let path = job.output().join("own.ply");
        write_ply(&path, &ellipsoid(DVec3::from(OWN.1), SPACING))?;
        let mut surfaces = vec![Surface { name: OWN.0.to_owned(), path, unit: Unit::Metre }];
        let real: Vec<PathBuf> = REAL.iter().map(|name| Path::new(DATA).join(name)).collect();
        let (there, absent): (Vec<PathBuf>, Vec<PathBuf>) = real.into_iter().partition(|path| path.is_file());
        surfaces.extend(there.iter().map(|path| named(path, Unit::Millimetre)));
        let skipped = absent.iter().map(|path| format!("{}: there is no such file", path.display())).collect();
        Ok((surfaces, skipped))
    }
}

/// Lifts the organ of `specimen` on `threads` threads and on one, and drags, in turns.
fn row(
    name: &str,
    specimen: &Specimen,
    folder: &Path,
    (threads, rounds): (usize, u32),
    progress: &dyn Progress,
) -> Result<LiftRow> {
    let Some(organ) = specimen.organs.first() else {
        return Err(Error::Mismatch(format!("{name}: has no organ")));
    };
    let alone = Organs {
        organs: vec![Organ { name: organ.name.clone(), mesh: upright(specimen, &organ.body) }],
        appendix: 0,
        source: name.to_owned(),
    };
    let elements = organ.body.tets.len();
    let six = Organs::analytic(elements)?;
    let (mut lifts, mut alone_lifts, mut own_drags, mut six_drags) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut held = true;
    for _ in 0..rounds {
        let (frames, holds) = lift(specimen, folder, threads, progress)?;
        held &= holds;
        lifts.push(frames);
        six_drags.push(drag(&six, threads, progress)?);
        if threads > 1 {
            alone_lifts.push(lift(specimen, folder, 1, progress)?.0);
        }
        own_drags.push(drag(&alone, threads, progress)?);
    }
    let (frames, one) = (medians(&lifts), medians(&alone_lifts));
    let (own_drag, six_drag) = (median(&mut own_drags), median(&mut six_drags));
    let mean_ms = mean(frames.iter().map(|f| f.ms));
    let one_ms = if one.is_empty() { mean_ms } else { mean(one.iter().map(|f| f.ms)) };
    let mut sorted: Vec<f64> = frames.iter().map(|f| f.ms).collect();
    sorted.sort_by(f64::total_cmp);
    let p95 = sorted.get(sorted.len().saturating_sub(1) * 95 / 100).copied().unwrap_or(f64::NAN);
    let phases = PHASES.iter().filter_map(|phase| {
        let of: Vec<&Frame> = frames.iter().filter(|f| f.phase == *phase).collect();
        (!of.is_empty()).then(|| PhaseTiming {
            phase: (*phase).to_owned(),
            frames: of.len(),
            ms_per_frame: mean(of.iter().map(|f| f.ms)),
            worst_ms: of.iter().map(|f| f.ms).fold(0.0, f64::max),
            iterations_per_frame: mean(of.iter().map(|f| f.iterations as f64)),
        })
    });
    Ok(LiftRow {
        organ: name.to_owned(),
        nodes: organ.body.vertices.len(),
        elements,
        frames: frames.len(),
        ms_per_frame_mean: mean_ms,
        ms_per_frame_p95: p95,
        one_thread_ms_per_frame: one_ms,
        own_drag_ms_per_frame: own_drag,
        six_drag_ms_per_frame: six_drag,
        lift_over_six: mean_ms / six_drag,
        lift_over_six_p95: p95 / six_drag,
        lift_over_own_drag: mean_ms / own_drag,
        two_threads_over_one: one_ms / mean_ms,
        real_time_factor: 1e3 * FRAME / mean_ms,
        held,
        phases: phases.collect(),
    })
}

/// The frames of several runs of a lift, each with the median of its times.
fn medians(lifts: &[Vec<Frame>]) -> Vec<Frame> {
    let Some(first) = lifts.first() else { return Vec::new() };
    let of = |(k, frame): (usize, &Frame)| {
        let mut times: Vec<f64> = lifts.iter().filter_map(|frames| frames.get(k)).map(|f| f.ms).collect();
        Frame { ms: median(&mut times), ..*frame }
    };
    first.iter().enumerate().map(of).collect()
}

/// The organ's mesh in the cell's frame, z up, as scenes of benchmarks have it.
fn upright(specimen: &Specimen, body: &trocar_geometry::TetMesh) -> trocar_geometry::TetMesh {
    let turn = glam::DQuat::from_rotation_arc(specimen.up, DVec3::Z);
    let mut mesh = body.clone();
    mesh.vertices.iter_mut().for_each(|p| *p = turn * *p);
    mesh
}

/// The frames of a scripted grasp-lift from the first contact of the jaws to their release, and
/// whether it held.
fn lift(specimen: &Specimen, folder: &Path, threads: usize, progress: &dyn Progress) -> Result<(Vec<Frame>, bool)> {
    let lift = Lift::default();
    let organ = task_organ(specimen, None)?;
    let mut scene = lift.arrange(free_scene(specimen, folder, organ, false)?)?;
    // One tissue frame per control period.
    scene.rates.control_hz = 60;
    let mut episode = Episode::new(&scene, specimen, threads)?;
    episode.reset(0)?;
    let mut policy = Scripted::following(lift.script);
    policy.begin(&episode, 0)?;
    let periods = scene.task.episode_s / episode.cell().period();
    progress.begin("lift", periods.round() as u64);
    let (mut frames, mut touched) = (Vec::new(), false);
    loop {
        let chunk = policy.act(&episode)?;
        if chunk.is_empty() {
            break;
        }
        let mut ended = false;
        for action in chunk {
            check_interrupted(progress)?;
            let before = episode.cell().timing();
            ended = episode.step(&action)?.end.is_some();
            let after = episode.cell().timing();
            touched |= episode.cell().observe().iter().any(|arm| arm.contact.length() > TOUCH_N);
            if touched && PHASES.contains(&policy.phase()) {
                frames.push(Frame {
                    phase: policy.phase(),
                    ms: 1e3 * (after.tissue - before.tissue).as_secs_f64(),
                    iterations: after.iterations - before.iterations,
                });
            }
            progress.advance(1);
            if ended {
                break;
            }
        }
        if ended {
            break;
        }
    }
    progress.end();
    Ok((frames, episode.summary().held))
}

/// Mean wall time of a frame of *drag* (ms).
fn drag(organs: &Organs, threads: usize, progress: &dyn Progress) -> Result<f64> {
    let scene = BenchScene::drag(organs, material(12e3, 0.45))?;
    let mut run = Run::new(&scene, solver_named("fast")?, threads)?;
    progress.begin("drag", (WARM_UP + DRAG_FRAMES) as u64);
    let timing = Timing::of(&mut run, WARM_UP, DRAG_FRAMES, f64::INFINITY, progress)?;
    progress.end();
    Ok(timing.frame_ms_mean)
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

fn document(r: &LiftResult) -> Document {
    let table = Table::of(
        &r.rows,
        &[
            ("Organ", &|row| row.organ.clone()),
            ("Elements", &|row| count(row.elements)),
            ("Held", &|row| if row.held { "yes" } else { "no" }.to_owned()),
            ("Frames", &|row| count(row.frames)),
            ("Mean (ms)", &|row| fixed(row.ms_per_frame_mean, 1)),
            ("p95 (ms)", &|row| fixed(row.ms_per_frame_p95, 1)),
            ("Real time", &|row| fixed(row.real_time_factor, 2)),
            ("Six, drag (ms)", &|row| fixed(row.six_drag_ms_per_frame, 1)),
            ("Over six", &|row| fixed(row.lift_over_six, 1)),
            ("p95 over six", &|row| fixed(row.lift_over_six_p95, 1)),
            ("Own drag (ms)", &|row| fixed(row.own_drag_ms_per_frame, 1)),
            ("Over own drag", &|row| fixed(row.lift_over_own_drag, 1)),
            ("Over one thread", &|row| fixed(row.two_threads_over_one, 2)),
        ],
    );
    let phases = Table::of(
        r.rows.iter().flat_map(|row| row.phases.iter().map(move |phase| (row, phase))),
        &[
            ("Organ", &|(row, _)| row.organ.clone()),
            ("Phase", &|(_, phase)| phase.phase.clone()),
            ("Frames", &|(_, phase)| count(phase.frames)),
            ("Mean (ms)", &|(_, phase)| fixed(phase.ms_per_frame, 1)),
            ("Worst (ms)", &|(_, phase)| fixed(phase.worst_ms, 1)),
            ("Iterations", &|(_, phase)| fixed(phase.iterations_per_frame, 0)),
        ],
    );
    let lead = "From the first contact of the jaws to their release. The time of a frame is its median over the \
                rounds. Six: a frame of drag of six organs with as many elements in all.";
    let machine = format!("{} threads on {}", r.threads, r.machine.described());
    let said = r.skipped.iter().cloned().chain(resumed(&r.resumed, "organ")).chain([machine]);
    Document::new("Lift", "Cost of one whole organ in the jaws")
        .with(Section::new("Organs", lead).table(table).lines(said))
        .with(Section::new("Phases", "").table(phases))
}
