//! What contact costs, of organs with the gripper and with each other: the grasp-lift of a whole specimen with all contact and with none, frame beside frame.

use super::machine::Machine;
use super::timing::median;
use crate::experiment::phantoms;
use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_cell::{FRAME, GraspDesign, GraspLift, Session};
use trocar_phantom::RecordOptions;
use trocar_progress::Progress;
use trocar_specimen::Specimen;

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
    /// Times that the pair of runs is repeated.
    pub repeats: usize,
    /// Worker threads, 0 for all.
    pub threads: usize,
}

/// One phase.
#[derive(Clone, Debug, Serialize)]
pub struct GraspPhaseTiming {
    /// Its name; "all" for all of them.
    pub phase: &'static str,
    /// Frames timed, each with contact and without.
    pub frames: usize,
    /// Median wall time of a frame with contact [ms].
    pub with_contact_ms: f64,
    /// The same without [ms].
    pub without_contact_ms: f64,
    /// Mean number of the solver's iterations in a frame with contact, of all organs and substeps.
    pub with_contact_iterations: f64,
    /// The same without.
    pub without_contact_iterations: f64,
    /// The slowest frame with contact [ms].
    pub worst_ms: f64,
    /// Share of the time with contact that contact costs, from the sums over the frames.
    pub contact_share: f64,
}

/// The benchmark's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct GraspBenchResult {
    /// 1/60 s over the median wall time of a frame with contact, all phases in which the gripper is near.
    pub real_time_factor: f64,
    /// The same without contact.
    pub real_time_factor_without_contact: f64,
    /// Share of the time that contact costs.
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
    /// Pairs of runs.
    pub repeats: usize,
    /// Worker threads.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

/// One frame of a pair.
struct Pair {
    phase: &'static str,
    with: Frame,
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
    /// Runs the pairs; a phantom that has to be recorded and its specimen go to the folder `output`.
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
        let (mut pairs, mut size, mut held) = (Vec::new(), (0, 0), false);
        for _ in 0..self.repeats {
            let (mut a, mut b) = (Session::new(&with, &specimen)?, Session::new(&without, &specimen)?);
            size = a.size();
            progress.begin("pair of runs", a.frames() as u64);
            let timed = pair(&mut a, &mut b, progress);
            progress.end();
            pairs.extend(timed?);
            held = a.finish().summary.held;
        }
        let all = timing("all", &pairs);
        Ok(GraspBenchResult {
            real_time_factor: 1e3 * FRAME / all.with_contact_ms,
            real_time_factor_without_contact: 1e3 * FRAME / all.without_contact_ms,
            contact_share: all.contact_share,
            phases: std::iter::once(all).chain(PHASES.map(|phase| timing(phase, &pairs))).collect(),
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

/// Steps both runs frame by frame, each first in every second frame, so that what disturbs the machine disturbs both.
fn pair(a: &mut Session<'_>, b: &mut Session<'_>, progress: &dyn Progress) -> Result<Vec<Pair>> {
    let mut times = Vec::new();
    for frame in 0.. {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let both = if frame % 2 == 0 {
            let first = a.advance()?;
            b.advance()? && first
        } else {
            let first = b.advance()?;
            a.advance()? && first
        };
        if !both {
            break;
        }
        progress.advance(1);
        let phase = |s: &Session<'_>| s.samples().last().map(|s| s.phase);
        if let (Some(phase), Some(other)) = (phase(a), phase(b))
            && phase == other
        {
            times.push(Pair { phase, with: Frame::of(a), without: Frame::of(b) });
        }
    }
    Ok(times)
}

fn timing(phase: &'static str, pairs: &[Pair]) -> GraspPhaseTiming {
    let chosen = |p: &&Pair| if phase == "all" { PHASES.contains(&p.phase) } else { p.phase == phase };
    let (with, without): (Vec<Frame>, Vec<Frame>) = pairs.iter().filter(chosen).map(|p| (p.with, p.without)).unzip();
    let seconds = |frames: &[Frame]| frames.iter().map(|f| f.seconds).collect::<Vec<f64>>();
    let iterations = |frames: &[Frame]| frames.iter().map(|f| f.iterations as f64).sum::<f64>() / frames.len() as f64;
    let (mut with_s, mut without_s) = (seconds(&with), seconds(&without));
    let contact_share = 1.0 - without_s.iter().sum::<f64>() / with_s.iter().sum::<f64>();
    GraspPhaseTiming {
        phase,
        frames: with.len(),
        with_contact_ms: 1e3 * median(&mut with_s),
        without_contact_ms: 1e3 * median(&mut without_s),
        with_contact_iterations: iterations(&with),
        without_contact_iterations: iterations(&without),
        worst_ms: 1e3 * with_s.last().copied().unwrap_or(f64::NAN),
        contact_share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_is_of_the_time_with_contact() {
        let frame = |seconds| Frame { seconds, iterations: 8 };
        let pair = |phase, with, without| Pair { phase, with: frame(with), without: frame(without) };
        let pairs = vec![pair("settle", 9.0, 0.1), pair("close", 0.004, 0.001), pair("lift", 0.002, 0.002)];
        let all = timing("all", &pairs);
        assert_eq!(all.frames, 2);
        assert!((all.contact_share - 0.5).abs() < 1e-12 && (all.with_contact_ms - 3.0).abs() < 1e-12);
        assert!((timing("close", &pairs).contact_share - 0.75).abs() < 1e-12);
        assert!(timing("open", &pairs).with_contact_ms.is_nan());
    }
}
