//! The grasp-lift task: settle, approach, close, lift 15 mm in 1 s, hold 1 s, lower, open.
//!
//! The gripper is a free-moving tool. It has no contact with tissue yet: its jaws stop where they would touch, and what is in
//! them is captured at its live pose (paper section IV-C, equation 4).

use crate::measure::{HELD_FOLLOW_RATIO, HELD_SLIP_MM, SETTLED_SPEED};
use crate::target::Target;
use crate::{Error, FRAME, Gripper, Result, Sample, Summary, World, gripper};
use glam::DVec3;
use std::time::Instant;
use trocar_progress::Progress;
use trocar_specimen::Specimen;
use trocar_tissue::{Grasp, Schedule, ToolMotion};

/// Height from which the gripper approaches [m].
const APPROACH_HEIGHT: f64 = 0.03;
/// Organs that have not come to rest after the settling phase are calmed for at most this many frames ...
const CALM_FRAMES: usize = 300;
/// ... until they have been slow, undisturbed, for this many.
const CALM_FOR: usize = 12;

/// More worker threads than any machine has cores.
const MOST_THREADS: usize = 1024;

/// How the task is run.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspLift {
    /// Organ to grasp; the appendix if there is one, else the first, when `None`.
    pub organ: Option<String>,
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// Jaw lift [m].
    pub lift: f64,
    /// How a frame is stepped.
    pub schedule: Schedule,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Keep a snapshot every this many frames, for the moving picture; 0 for none.
    pub snapshot_every: usize,
}

impl Default for GraspLift {
    fn default() -> Self {
        Self { organ: None, at: 0.5, lift: 0.015, schedule: Schedule::default(), threads: 0, snapshot_every: 0 }
    }
}

/// Shapes at one instant, for pictures.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time [s].
    pub time_s: f64,
    /// Phase of the task.
    pub phase: Phase,
    /// Node positions of each organ [m].
    pub nodes: Vec<Vec<DVec3>>,
    /// The gripper.
    pub gripper: Gripper,
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct GraspLiftRun {
    /// In figures.
    pub summary: Summary,
    /// Frame by frame.
    pub samples: Vec<Sample>,
    /// Shapes, if asked for.
    pub snapshots: Vec<Snapshot>,
}

/// The phases of the task, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The organs come to rest under gravity.
    Settle,
    /// The open gripper comes down.
    Approach,
    /// The jaws close.
    Close,
    /// The jaws rise.
    Lift,
    /// They stay up.
    Hold,
    /// They come down.
    Lower,
    /// They open and the tissue is free again.
    Open,
}

impl Phase {
    const ALL: [Self; 7] = [Self::Settle, Self::Approach, Self::Close, Self::Lift, Self::Hold, Self::Lower, Self::Open];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Settle => "settle",
            Self::Approach => "approach",
            Self::Close => "close",
            Self::Lift => "lift",
            Self::Hold => "hold",
            Self::Lower => "lower",
            Self::Open => "open",
        }
    }

    /// How long it takes [s].
    fn seconds(self) -> f64 {
        match self {
            Self::Settle | Self::Lift | Self::Hold | Self::Lower => 1.0,
            Self::Approach | Self::Close => 0.25,
            Self::Open => 0.5,
        }
    }

    fn frames(self) -> usize {
        (self.seconds() / FRAME).round() as usize
    }
}

impl GraspLift {
    /// Runs the task on `specimen`.
    ///
    /// # Errors
    /// Names the organ that is not there, the option out of range, or the place where nothing can be grasped.
    pub fn run(&self, specimen: &Specimen, progress: &dyn Progress) -> Result<GraspLiftRun> {
        let mut run = Run::new(self, specimen)?;
        progress.begin("simulate", Phase::ALL.iter().map(|p| p.frames() as u64).sum());
        for phase in Phase::ALL {
            run.enter(phase)?;
            for frame in 1..=phase.frames() {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                run.step(phase, frame as f64 / phase.frames() as f64);
                progress.advance(1);
                if run.summary.diverged {
                    progress.end();
                    return Ok(run.finish());
                }
            }
            run.leave(phase);
            if phase == Phase::Settle {
                run.calm(progress)?;
                if run.summary.diverged {
                    break;
                }
            }
        }
        progress.end();
        Ok(run.finish())
    }

    fn validate(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.at) {
            return Err(Error::Option(format!(
                "--at is {}; the organ coordinate runs from 0 (base) to 1 (tip)",
                self.at
            )));
        }
        if !(self.lift > 0.0 && self.lift <= 0.1) {
            return Err(Error::Option(format!("--lift is {} mm; more than 0 and at most 100 mm", self.lift * 1e3)));
        }
        if self.threads > MOST_THREADS {
            return Err(Error::Option(format!(
                "--threads is {}; at most {MOST_THREADS}, and 0 for all there are",
                self.threads
            )));
        }
        Ok(())
    }
}

/// What was true when the jaws closed.
struct Activation {
    centroid: DVec3,
    /// The centroid in the jaw frame.
    centroid_in_jaw: DVec3,
    jaw: DVec3,
}

/// A run in progress.
struct Run<'a> {
    task: &'a GraspLift,
    organ: usize,
    world: World,
    start: trocar_tissue::State,
    target: Option<Target>,
    activation: Option<Activation>,
    gripper: Gripper,
    frame: usize,
    stepping: std::time::Duration,
    summary: Summary,
    samples: Vec<Sample>,
    snapshots: Vec<Snapshot>,
}

impl<'a> Run<'a> {
    fn new(task: &'a GraspLift, specimen: &Specimen) -> Result<Self> {
        task.validate()?;
        let organ = choose_organ(specimen, task.organ.as_deref())?;
        let world = World::new(specimen, task.schedule, task.threads)?;
        let summary = Summary {
            organ: specimen.organs[organ].name.clone(),
            at: task.at,
            inverted_rest: specimen.organs.iter().map(|o| o.body.inverted()).sum(),
            min_volume_ratio: 1.0,
            ..Summary::default()
        };
        let above = world.state.centroid(&world.model, organ, &[0]) + 0.1 * world.up;
        let gripper = Gripper::over(above, world.up, DVec3::X, gripper::MAX_ANGLE);
        let start = world.state.clone();
        Ok(Self {
            task,
            organ,
            world,
            start,
            target: None,
            activation: None,
            gripper,
            frame: 0,
            stepping: std::time::Duration::ZERO,
            summary,
            samples: Vec::new(),
            snapshots: Vec::new(),
        })
    }

    /// Takes the swing out of organs that still move when the settling phase is over: a large soft organ swings for many seconds. Kinetic damping
    /// (Cundall 1976): everything is stopped whenever the kinetic energy has passed a peak, until nothing moves fast for a while by itself.
    fn calm(&mut self, progress: &dyn Progress) -> Result<()> {
        let mut energy = self.world.state.kinetic_energy(&self.world.model);
        // Frames in a row that were slow without having been stopped.
        let mut slow_for = if self.summary.settled { CALM_FOR } else { 0 };
        for _ in 0..CALM_FRAMES {
            if slow_for >= CALM_FOR || self.summary.diverged {
                break;
            }
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            self.step(Phase::Settle, 1.0);
            self.summary.calmed_s += FRAME;
            let now = self.world.state.kinetic_energy(&self.world.model);
            if self.samples.last().is_some_and(|s| s.max_speed_m_s < SETTLED_SPEED) {
                // Slow: left alone, to show that it stays so.
                slow_for += 1;
                energy = now;
            } else if now < energy {
                self.world.state.stop();
                (slow_for, energy) = (0, 0.0);
            } else {
                (slow_for, energy) = (0, now);
            }
        }
        self.summary.resting_speed_m_s = self.samples.last().map_or(0.0, |s| s.max_speed_m_s);
        Ok(())
    }

    /// What happens at the instant a phase begins.
    fn enter(&mut self, phase: Phase) -> Result<()> {
        match phase {
            Phase::Approach => self.target = Some(Target::choose(&self.world, self.organ, self.task.at)?),
            Phase::Lift => self.activate(),
            Phase::Open => self.world.state.grasps.clear(),
            _ => {}
        }
        Ok(())
    }

    /// What is measured at the instant a phase ends.
    fn leave(&mut self, phase: Phase) {
        match phase {
            Phase::Settle => {
                self.summary.settled_speed_m_s = self.samples.last().map_or(0.0, |s| s.max_speed_m_s);
                self.summary.settled = self.summary.settled_speed_m_s < SETTLED_SPEED;
            }
            Phase::Hold => {
                let Some(sample) = self.samples.last() else { return };
                self.summary.lift_mm = sample.tissue_lift_mm;
                self.summary.slip_mm = sample.slip_mm;
                self.summary.follow_ratio = sample.tissue_lift_mm / sample.jaw_lift_mm;
                self.summary.held =
                    self.summary.follow_ratio >= HELD_FOLLOW_RATIO && self.summary.slip_mm < HELD_SLIP_MM;
            }
            _ => {}
        }
    }

    /// One frame: move the gripper, step the world, measure. `share` of the phase is over at the frame's end.
    fn step(&mut self, phase: Phase, share: f64) {
        let from = self.gripper.pose;
        self.gripper = self.gripper_at(phase, share);
        let before = (phase == Phase::Lift && self.summary.activation_step_mm == 0.0).then(|| self.world.state.clone());
        let clock = Instant::now();
        let report = self.world.step(&[ToolMotion { from, to: self.gripper.pose }]);
        self.stepping += clock.elapsed();
        self.frame += 1;
        if let Some(before) = before {
            self.summary.activation_step_mm = self.largest_motion_since(&before, |_, _| true);
        }
        self.record(phase, &report);
    }

    /// The gripper's course through a phase; `share` runs from 0 to 1.
    fn gripper_at(&self, phase: Phase, share: f64) -> Gripper {
        let Some(target) = &self.target else { return self.gripper };
        let mut gripper = target.open;
        let eased = smoothstep(share);
        let (height, opening) = match phase {
            Phase::Settle => (APPROACH_HEIGHT, 1.0),
            Phase::Approach => (APPROACH_HEIGHT * (1.0 - eased), 1.0),
            Phase::Close => (0.0, 1.0 - eased),
            Phase::Lift => (self.task.lift * eased, 0.0),
            Phase::Hold => (self.task.lift, 0.0),
            Phase::Lower => (self.task.lift * (1.0 - eased), 0.0),
            Phase::Open => (0.0, eased),
        };
        gripper.pose.translation += height * self.world.up;
        gripper.jaw_angle = target.closed_angle + (target.open.jaw_angle - target.closed_angle) * opening;
        gripper
    }

    /// Closes the grasp: the nodes in the jaws are captured where they are.
    fn activate(&mut self) {
        let Some(target) = &self.target else { return };
        let (world, organ) = (&mut self.world, self.organ);
        let grasp = Grasp::capture(&world.model, &world.state, organ, &target.cluster.nodes, 0, &self.gripper.pose);
        self.summary.snap_mm = grasp
            .prescribed(&self.gripper.pose)
            .map(|(i, x)| (x - world.state.position(&world.model, organ, i as usize)).length())
            .fold(0.0, f64::max)
            * 1e3;
        self.summary.held_nodes = target.cluster.nodes.len();
        self.summary.at = target.cluster.s;
        let centroid = target.cluster.centroid(world, organ);
        self.activation = Some(Activation {
            centroid,
            centroid_in_jaw: self.gripper.pose.inverse().transform(centroid),
            jaw: self.gripper.pose.translation,
        });
        world.state.grasps = vec![grasp];
    }

    fn record(&mut self, phase: Phase, report: &trocar_tissue::StepReport) {
        let (mut jaw_lift, mut tissue_lift, mut slip) = (0.0, 0.0, 0.0);
        if let (Some(target), Some(activation)) = (&self.target, &self.activation) {
            let centroid = target.cluster.centroid(&self.world, self.organ);
            jaw_lift = (self.gripper.pose.translation - activation.jaw).dot(self.world.up);
            tissue_lift = (centroid - activation.centroid).dot(self.world.up);
            slip = (self.gripper.pose.inverse().transform(centroid) - activation.centroid_in_jaw).length();
        }
        let sample = Sample {
            time_s: self.frame as f64 * FRAME,
            phase: phase.name(),
            jaw_lift_mm: jaw_lift * 1e3,
            tissue_lift_mm: tissue_lift * 1e3,
            slip_mm: slip * 1e3,
            max_speed_m_s: report.max_speed,
            inverted: report.inverted,
            min_volume_ratio: report.min_volume_ratio,
        };
        let summary = &mut self.summary;
        summary.yielded_substeps += report.grasp_limited;
        summary.inverted_peak = summary.inverted_peak.max(sample.inverted);
        summary.min_volume_ratio = summary.min_volume_ratio.min(sample.min_volume_ratio);
        summary.peak_speed_m_s = summary.peak_speed_m_s.max(sample.max_speed_m_s);
        if let Some(why) = report.divergence {
            summary.diverged = true;
            summary.divergence = Some(why.to_string());
        }
        self.samples.push(sample);
        if self.task.snapshot_every > 0 && self.frame.is_multiple_of(self.task.snapshot_every) {
            let organs = 0..self.world.model.bodies().len();
            self.snapshots.push(Snapshot {
                time_s: sample.time_s,
                phase,
                nodes: organs.map(|k| self.world.state.positions(&self.world.model, k)).collect(),
                gripper: self.gripper,
            });
        }
    }

    fn finish(mut self) -> GraspLiftRun {
        let pinned = |organ: usize, node: usize| self.world.model.bodies()[organ].pinned()[node];
        let pin_drift_mm = self.largest_motion_since(&self.start, pinned);
        let summary = &mut self.summary;
        summary.pin_drift_mm = pin_drift_mm;
        summary.simulated_s = self.frame as f64 * FRAME;
        summary.wall_s = self.stepping.as_secs_f64();
        summary.real_time_factor = summary.simulated_s / summary.wall_s;
        summary.state_hash = format!("{:016x}", self.world.state.hash());
        GraspLiftRun { summary: self.summary, samples: self.samples, snapshots: self.snapshots }
    }

    /// Largest distance [mm] that any node chosen by (organ, node) has moved since `then`.
    fn largest_motion_since(&self, then: &trocar_tissue::State, chosen: impl Fn(usize, usize) -> bool) -> f64 {
        let model = &self.world.model;
        let mut largest: f64 = 0.0;
        for organ in 0..model.bodies().len() {
            let (now, then) = (self.world.state.positions(model, organ), then.positions(model, organ));
            for i in (0..now.len()).filter(|i| chosen(organ, *i)) {
                largest = largest.max((now[i] - then[i]).length());
            }
        }
        largest * 1e3
    }
}

fn choose_organ(specimen: &Specimen, name: Option<&str>) -> Result<usize> {
    let find = |name: &str| specimen.organs.iter().position(|o| o.name == name);
    match name {
        Some(name) => find(name).ok_or_else(|| Error::UnknownOrgan {
            name: name.to_owned(),
            known: specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", "),
        }),
        None if specimen.organs.is_empty() => Err(Error::Option("the specimen has no organ".to_owned())),
        None => Ok(find("appendix").unwrap_or(0)),
    }
}

/// 0 to 1 with zero slope at both ends, so that the tool starts and stops without a jerk.
fn smoothstep(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
