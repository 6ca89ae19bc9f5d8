//! What contact costs, of organs with the gripper and with each other: the grasp-lift of a whole specimen with all contact, and without, frame beside frame.
//!
//! Without contact there are two runs. In one nothing takes its place: jaws pass through tissue that stays at rest, and what is saved is contact and all motion that it causes. In the other every
//! frame starts where the run with contact started it, and every node gets the force that contact did to it at the frame's end, so that tissue moves alike: what is saved is contact alone (finding it, its forces, and
//! the iterations that its stiffness costs).

use super::machine::Machine;
use super::timing::median;
use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_cell::{FRAME, GraspDesign, GraspLift, Session};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_specimen::Specimen;
use trocar_workflow::phantoms;

/// Phases that are timed: those in which the gripper is near the tissue.
const PHASES: [&str; 6] = ["approach", "close", "lift", "hold", "lower", "open"];

/// Most repetitions anyone means.
const MOST_REPEATS: usize = 1000;

/// The benchmark's options.
#[derive(Clone, Debug)]
pub struct GraspBench {
    /// A specimen folder; phantom A, recorded and reconstructed, when `None`.
    pub specimen: Option<PathBuf>,
    /// How the phantom is filmed.
    pub record: RecordOptions,
    /// Grasp design.
    pub design: GraspDesign,
    /// Force of the jaws [N].
    pub jaw_force: f64,
    /// Times that the runs are repeated.
    pub repeats: usize,
    /// Worker threads, 0 for all.
    pub threads: usize,
}

/// One phase.
#[derive(Clone, Debug, Serialize)]
pub struct GraspPhaseTiming {
    /// Its name; "all" for all of them.
    pub phase: &'static str,
    /// Frames timed, of each run.
    pub frames: usize,
    /// Median wall time of a frame with contact [ms].
    pub with_contact_ms: f64,
    /// The same without, under the forces that contact did [ms].
    pub same_motion_ms: f64,
    /// How far a node was from where contact had it after a frame under contact's forces, median over the frames [mm].
    pub same_motion_off_mm: f64,
    /// The same without contact and its forces [ms].
    pub without_contact_ms: f64,
    /// Mean number of the solver's iterations in a frame with contact, of all organs and substeps.
    pub with_contact_iterations: f64,
    /// The same without, under the forces that contact did.
    pub same_motion_iterations: f64,
    /// The same without contact and its forces.
    pub without_contact_iterations: f64,
    /// The slowest frame with contact [ms].
    pub worst_ms: f64,
    /// Share of the time with contact that contact costs: more than the same motion without, from the sums over the frames.
    pub own_share: f64,
    /// Share of it that contact and all motion it causes cost: more than without contact and its forces.
    pub contact_share: f64,
}

/// The benchmark's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct GraspBenchResult {
    /// 1/60 s over the median wall time of a frame with contact, all phases in which the gripper is near.
    pub real_time_factor: f64,
    /// The same without contact and its forces.
    pub real_time_factor_without_contact: f64,
    /// Share of the time that contact costs: more than the same motion without.
    pub own_share: f64,
    /// Share of it that contact and all motion it causes cost.
    pub contact_share: f64,
    /// Phase by phase, and all of them first.
    pub phases: Vec<GraspPhaseTiming>,
    /// The grasp design's name.
    pub design: &'static str,
    /// It held, with contact.
    pub held: bool,
    /// Organs.
    pub organs: usize,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub tets: usize,
    /// Times that they were run.
    pub repeats: usize,
    /// Worker threads.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

/// One frame of each run.
struct Frames {
    phase: &'static str,
    with: Frame,
    same_motion: Frame,
    /// How far a node of the same motion was from where contact had it, at most [m].
    off: f64,
    without: Frame,
}

/// One frame of one run.
#[derive(Clone, Copy)]
struct Frame {
    /// Wall time [s].
    seconds: f64,
    /// The solver's iterations.
    iterations: usize,
}

impl Frame {
    fn of(session: &Session<'_>) -> Self {
        Self { seconds: session.last_step().as_secs_f64(), iterations: session.last_iterations() }
    }
}

impl GraspBench {
    /// Does the runs; a phantom that has to be recorded and its specimen go to the folder `output`.
    ///
    /// # Errors
    /// A specimen that cannot be had or simulated, an option out of range, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<GraspBenchResult> {
        if !(1..=MOST_REPEATS).contains(&self.repeats) {
            return Err(Error::Mismatch(format!("{} repetitions; 1 to {MOST_REPEATS} make sense", self.repeats)));
        }
        let specimen = match &self.specimen {
            Some(folder) => Specimen::read(folder)?,
            None => phantoms::specimen("phantom-a", &self.record, &output.join("phantom-a"), progress)?,
        };
        let machine = Machine::here();
        let with =
            GraspLift { design: self.design, jaw_force: self.jaw_force, threads: self.threads, ..GraspLift::default() };
        let without = GraspLift { contact: false, ..with.clone() };
        let (mut times, mut size, mut held) = (Vec::new(), (0, 0), false);
        for _ in 0..self.repeats {
            let mut a = Session::new(&with, &specimen)?;
            let (mut b, mut c) = (Session::new(&without, &specimen)?, Session::new(&without, &specimen)?);
            size = a.size();
            progress.begin("three runs side by side", a.frames() as u64);
            let timed = together([&mut a, &mut b, &mut c], progress);
            progress.end();
            times.extend(timed?);
            held = a.finish().summary.held;
        }
        let all = timing("all", &times);
        Ok(GraspBenchResult {
            real_time_factor: 1e3 * FRAME / all.with_contact_ms,
            real_time_factor_without_contact: 1e3 * FRAME / all.without_contact_ms,
            own_share: all.own_share,
            contact_share: all.contact_share,
            phases: std::iter::once(all).chain(PHASES.map(|phase| timing(phase, &times))).collect(),
            design: self.design.name(),
            held,
            organs: specimen.organs.len(),
            nodes: size.0,
            tets: size.1,
            repeats: self.repeats,
            threads: if self.threads == 0 { machine.cores } else { self.threads },
            machine,
        })
    }
}

/// Steps the runs frame by frame in changing order, so that what disturbs the machine disturbs all.
fn together(runs: [&mut Session<'_>; 3], progress: &dyn Progress) -> Result<Vec<Frames>> {
    let [a, b, c] = runs;
    let mut times = Vec::new();
    for frame in 0.. {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let before = a.moment();
        let all = match frame % 3 {
            0 => [b.advance()?, a.advance()?, c.shadow(a, &before)?],
            1 => [a.advance()?, b.advance()?, c.shadow(a, &before)?],
            _ => [a.advance()?, c.shadow(a, &before)?, b.advance()?],
        };
        if all.contains(&false) {
            break;
        }
        progress.advance(1);
        let phase = |s: &Session<'_>| s.samples().last().map(|s| s.phase);
        if let Some(phase) = phase(a).filter(|p| [phase(b), phase(c)] == [Some(*p); 2]) {
            times.push(Frames {
                phase,
                off: c.off(a),
                with: Frame::of(a),
                same_motion: Frame::of(c),
                without: Frame::of(b),
            });
        }
    }
    Ok(times)
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

/// Frames of one run.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_of_the_time_with_contact() {
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
