//! Cost of contact: the grasp-lift of a whole specimen with contact and without, frame by frame.
//!
//! Two runs have no contact. In the first nothing replaces it: the jaws pass through the tissue.
//! When they have grasped it in the run with contact, they hold the same nodes in this run, so both
//! lift it. The difference is contact and the motion that contact causes. In the second run each
//! frame starts from the state of the run with contact, and each node gets the force that contact
//! had at the end of the frame. The tissue moves alike, so the difference is contact alone:
//! detection, forces, and the iterations that its stiffness costs.
//!
//! With the friction design the run without contact holds nothing.

use crate::machine::{Machine, Setup};
use crate::names::{AppendixChoice, DesignName, design_name};
use crate::statistics::median;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use trocar_cell::{Cell, ContactParts, FRAME, Timing};
use trocar_core::Progress;
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{fixed, percent};
use trocar_task::policy::Scripted;
use trocar_task::{Episode, Policy, SETTLE_S};
use trocar_workflow::specimen_scene::{free_scene, task_organ};
use trocar_workflow::{Lift, check_interrupted};

/// The timed phases: those with the jaws near the tissue.
const PHASES: [&str; 6] = ["enter", "close", "lift", "hold", "lower", "open"];

/// Maximum of `--repeats`.
const MAX_REPEATS: usize = 1000;

/// Cost of contact with the gripper in a grasp-lift of all organs.
#[derive(Clone, Debug, Args)]
pub struct GraspBench {
    /// The specimen.
    #[command(flatten)]
    pub specimen: AppendixChoice,
    /// How the jaws hold.
    #[arg(long, value_enum, default_value_t = DesignName::LivePose)]
    pub design: DesignName,
    /// Closing force of the jaws (N).
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Repetitions of the runs with and without contact.
    #[arg(long, default_value_t = 3)]
    pub repeats: usize,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Times of one phase.
#[derive(Clone, Debug, Serialize)]
pub struct GraspPhaseTiming {
    /// Name of the phase; "all" for all phases.
    pub phase: &'static str,
    /// Timed frames of each run.
    pub frames: usize,
    /// Median wall time of a frame with contact (ms).
    pub with_contact_ms: f64,
    /// The same without contact, with its forces (ms).
    pub same_motion_ms: f64,
    /// Largest distance of a node between the two after a frame, median over the frames (mm).
    pub same_motion_off_mm: f64,
    /// The same without contact and without its forces (ms).
    pub without_contact_ms: f64,
    /// Mean solver iterations per frame with contact, over all organs and substeps.
    pub with_contact_iterations: f64,
    /// The same without contact, with its forces.
    pub same_motion_iterations: f64,
    /// The same without contact and without its forces.
    pub without_contact_iterations: f64,
    /// Slowest frame with contact (ms).
    pub worst_ms: f64,
    /// Share of contact in the time with contact: 1 minus the time of the same motion over it.
    pub own_share: f64,
    /// Share of contact and the motion it causes: 1 minus the time without contact over it.
    pub contact_share: f64,
}

/// Figures of the benchmark.
#[derive(Clone, Debug, Serialize)]
pub struct GraspBenchResult {
    /// 1/60 s over the median wall time of a frame with contact, in all timed phases.
    pub real_time_factor: f64,
    /// The same without contact and without its forces.
    pub real_time_factor_without_contact: f64,
    /// Share of contact in the time with contact.
    pub own_share: f64,
    /// Share of contact and the motion it causes.
    pub contact_share: f64,
    /// All phases together, then each phase.
    pub phases: Vec<GraspPhaseTiming>,
    /// Name of the grasp design.
    pub design: &'static str,
    /// Whether the lift with contact held.
    pub held: bool,
    /// Repetitions.
    pub repeats: usize,
    /// What was stepped, and on what.
    #[serde(flatten)]
    pub setup: Setup,
}

struct Frames {
    phase: &'static str,
    with: Frame,
    same_motion: Frame,
    /// Largest distance of a node between the same motion and the run with contact (m).
    off: f64,
    without: Frame,
}

#[derive(Clone, Copy)]
struct Frame {
    /// Wall time of the tissue (s).
    seconds: f64,
    iterations: usize,
}

impl Frame {
    /// The difference between two readings of a cell's timing.
    fn between(before: Timing, after: Timing) -> Self {
        let seconds = (after.tissue - before.tissue).as_secs_f64();
        Self { seconds, iterations: after.iterations - before.iterations }
    }
}

impl Study for GraspBench {
    const NAME: &'static str = "grasp";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> =
        Some("Folder of the phantom's recording and specimen. A finished recording in it is used again.");
    const WRITES_OWN_FILES: bool = true;
    type Figures = GraspBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(GraspBenchResult, Document)> {
        if !(1..=MAX_REPEATS).contains(&self.repeats) {
            return Err(Error::Mismatch(format!("--repeats {}: must be in [1, {MAX_REPEATS}]", self.repeats)));
        }
        let (progress, design) = (job.progress, self.design.into());
        let (specimen, folder) = self.specimen.read(job.output(), progress)?;
        let machine = Machine::here();
        let lift = Lift { design: Some(design), jaw_force: Some(self.jaw_force), ..Lift::default() };
        let organ = task_organ(&specimen, None)?;
        let mut scene = lift.arrange(free_scene(&specimen, &folder, organ, false)?)?;
        // One tissue frame per control period, so that frames can be compared.
        scene.rates.control_hz = 60;
        let (mut times, mut held) = (Vec::new(), false);
        let mut with = Episode::new(&scene, &specimen, self.threads)?;
        for _ in 0..self.repeats {
            let none = ContactParts { organs: false, instruments: false };
            let mut without = Cell::with_contact(&scene, &specimen, self.threads, none)?;
            let mut same = Cell::with_contact(&scene, &specimen, self.threads, none)?;
            without.settle(SETTLE_S)?;
            with.reset(0)?;
            let mut policy = Scripted::following(lift.script);
            let periods = scene.task.episode_s / with.cell().period();
            progress.begin("three runs", periods.round() as u64);
            times.extend(together(&mut with, &mut policy, [&mut same, &mut without], progress)?);
            progress.end();
            held = with.summary().held;
        }
        let all = timing("all", &times);
        let result = GraspBenchResult {
            real_time_factor: 1e3 * FRAME / all.with_contact_ms,
            real_time_factor_without_contact: 1e3 * FRAME / all.without_contact_ms,
            own_share: all.own_share,
            contact_share: all.contact_share,
            phases: std::iter::once(all).chain(PHASES.map(|phase| timing(phase, &times))).collect(),
            design: design_name(design),
            held,
            repeats: self.repeats,
            setup: Setup::new(&with.cell().world().model, self.threads, machine),
        };
        let document = document(&result);
        Ok((result, document))
    }
}

/// Steps the runs frame by frame in alternating order, so that disturbances of the machine affect
/// all.
fn together(
    with: &mut Episode,
    policy: &mut Scripted,
    [same, without]: [&mut Cell; 2],
    progress: &dyn Progress,
) -> Result<Vec<Frames>> {
    policy.begin(with, 0)?;
    let mut times = Vec::new();
    loop {
        let chunk = policy.act(with)?;
        if chunk.is_empty() {
            return Ok(times);
        }
        for action in chunk {
            check_interrupted(progress)?;
            let clocks = (with.cell().timing(), without.timing());
            let before = with.cell().moment();
            if times.len().is_multiple_of(2) {
                without.step(&action)?;
            }
            let ended = with.step(&action)?.end.is_some();
            let (report, took) = same.shadow(with.cell(), &before);
            if !times.len().is_multiple_of(2) {
                without.step(&action)?;
            }
            without.hold_as(with.cell());
            times.push(Frames {
                phase: policy.phase(),
                with: Frame::between(clocks.0, with.cell().timing()),
                same_motion: Frame { seconds: took.as_secs_f64(), iterations: report.iterations },
                off: same.distance_from(with.cell()),
                without: Frame::between(clocks.1, without.timing()),
            });
            progress.advance(1);
            if ended {
                return Ok(times);
            }
        }
    }
}

fn timing(phase: &'static str, frames: &[Frames]) -> GraspPhaseTiming {
    let chosen = |f: &&Frames| if phase == "all" { PHASES.contains(&f.phase) } else { f.phase == phase };
    let of = |run: fn(&Frames) -> Frame| Run(frames.iter().filter(chosen).map(run).collect());
    let (with, same_motion, without) = (of(|f| f.with), of(|f| f.same_motion), of(|f| f.without));
    let mut off: Vec<f64> = frames.iter().filter(chosen).map(|f| f.off).collect();
    GraspPhaseTiming {
        phase,
        frames: with.0.len(),
        with_contact_ms: with.median_ms(),
        same_motion_ms: same_motion.median_ms(),
        same_motion_off_mm: 1e3 * median(&mut off),
        without_contact_ms: without.median_ms(),
        with_contact_iterations: with.iterations(),
        same_motion_iterations: same_motion.iterations(),
        without_contact_iterations: without.iterations(),
        worst_ms: 1e3 * with.0.iter().map(|f| f.seconds).fold(f64::NAN, f64::max),
        own_share: 1.0 - same_motion.seconds() / with.seconds(),
        contact_share: 1.0 - without.seconds() / with.seconds(),
    }
}

struct Run(Vec<Frame>);

impl Run {
    fn seconds(&self) -> f64 {
        self.0.iter().map(|f| f.seconds).sum()
    }

    fn iterations(&self) -> f64 {
        self.0.iter().map(|f| f.iterations as f64).sum::<f64>() / self.0.len() as f64
    }

    fn median_ms(&self) -> f64 {
        1e3 * median(&mut self.0.iter().map(|f| f.seconds).collect::<Vec<f64>>())
    }
}

fn document(r: &GraspBenchResult) -> Document {
    let iterations = |p: &GraspPhaseTiming| {
        [p.with_contact_iterations, p.same_motion_iterations, p.without_contact_iterations]
            .map(|n| fixed(n, 0))
            .join("/")
    };
    let table = Table::of(
        &r.phases,
        &[
            ("Phase", &|p| p.phase.to_owned()),
            ("Frames", &|p| p.frames.to_string()),
            ("Contact (ms)", &|p| fixed(p.with_contact_ms, 2)),
            ("Same motion (ms)", &|p| fixed(p.same_motion_ms, 2)),
            ("Distance (mm)", &|p| fixed(p.same_motion_off_mm, 4)),
            ("No contact (ms)", &|p| fixed(p.without_contact_ms, 2)),
            ("Iterations", &|p| iterations(p)),
            ("Worst (ms)", &|p| fixed(p.worst_ms, 2)),
            ("Own share", &|p| percent(p.own_share, 1)),
            ("Contact's share", &|p| percent(p.contact_share, 1)),
        ],
    );
    let lines = [
        "Same motion: each frame again without contact but with its forces. No contact: without contact and its forces, with the same grasp."
            .to_owned(),
        format!(
            "{}x real time with contact, {}x without; {} grasp, {}; {}",
            fixed(r.real_time_factor, 2),
            fixed(r.real_time_factor_without_contact, 2),
            r.design,
            if r.held { "held" } else { "NOT held" },
            r.setup.described()
        ),
    ];
    Document::new("Grasp", "Cost of contact with the gripper")
        .with(Section::new("Phases", "").table(table).lines(lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_the_time_with_contact() {
        let frame = |seconds| Frame { seconds, iterations: 8 };
        let frames = |phase, [with, same_motion, without]: [f64; 3]| Frames {
            phase,
            with: frame(with),
            same_motion: frame(same_motion),
            off: 0.0,
            without: frame(without),
        };
        let timed = vec![
            frames("settle", [9.0, 9.0, 0.1]),
            frames("close", [0.004, 0.003, 0.001]),
            frames("lift", [0.002, 0.0015, 0.002]),
        ];
        let all = timing("all", &timed);
        assert_eq!(all.frames, 2);
        assert!((all.own_share - 0.25).abs() < 1e-12 && (all.contact_share - 0.5).abs() < 1e-12);
        assert!((all.with_contact_ms - 3.0).abs() < 1e-12);
        assert!((timing("close", &timed).own_share - 0.25).abs() < 1e-12);
        assert!(timing("open", &timed).with_contact_ms.is_nan());
    }
}
