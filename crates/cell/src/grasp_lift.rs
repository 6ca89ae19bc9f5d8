//! The grasp-lift task: settle, approach, close, lift 15 mm in 1 s, hold 1 s, lower, open.
//!
//! The gripper moves freely. Its blades and shaft touch the tissue; its jaws close with a force, and hold what is between them by one of the designs of
//! [`GraspDesign`]. With a cut asked for, a second instrument parts the organ after the hold, and what came loose is lifted on.

use crate::jaw::JAW_FORCE;
use crate::{CutOrgan, Error, GraspDesign, Gripper, Phase, Result, Sample, Session, Summary};
use glam::DVec3;
use trocar_core::Progress;
use trocar_specimen::Specimen;
use trocar_tissue::SolverSettings;

/// More worker threads than any machine has cores.
const MOST_THREADS: usize = 1024;

/// Largest force of the jaws [N]: that of a strong hand at a laparoscopic grasper's blades.
const MOST_FORCE: f64 = 40.0;

/// Farthest that the gripper comes beside the tissue, or drags it [m].
const FARTHEST: f64 = 0.05;

/// How the task is run.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspLift {
    /// Organ to grasp; the appendix if there is one, else the first, when `None`.
    pub organ: Option<String>,
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// Jaw lift [m].
    pub lift: f64,
    /// How the jaws hold.
    pub design: GraspDesign,
    /// Force with which they close [N].
    pub jaw_force: f64,
    /// How far beside the tissue's middle the gripper comes [m], across the organ.
    pub approach_offset: f64,
    /// The jaws first drag the tissue sideways by this much [m], by a live-pose grasp, let go of it there and close again.
    pub regrasp: Option<f64>,
    /// After the hold, lower what was lifted and let go of it.
    pub lower: bool,
    /// After the hold, cut the organ between the grasp and what holds it, and lift on instead of lowering.
    pub sever: Option<SeverAt>,
    /// Blades and shaft touch the tissue, and organs each other. Without, jaws stop where they would touch it.
    pub contact: bool,
    /// How a frame is stepped.
    pub schedule: SolverSettings,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Keep a snapshot every this many frames, for the moving picture; 0 for none.
    pub snapshot_every: usize,
}

impl Default for GraspLift {
    fn default() -> Self {
        Self {
            organ: None,
            at: 0.5,
            lift: 0.015,
            design: GraspDesign::default(),
            jaw_force: JAW_FORCE,
            approach_offset: 0.0,
            regrasp: None,
            lower: true,
            sever: None,
            contact: true,
            schedule: SolverSettings::default(),
            threads: 0,
            snapshot_every: 0,
        }
    }
}

/// Where the organ is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeverAt {
    /// Half way between the grasp and the pinned part.
    Between,
    /// At an organ coordinate, 0 to 1.
    S(f64),
}

/// Shapes at one instant, for pictures.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time [s].
    pub time_s: f64,
    /// Phase of the task.
    pub phase: Phase,
    /// Node positions of each organ [m]; those of an organ that has been cut are [`CutOrgan::parents`]' copies.
    pub nodes: Vec<Vec<DVec3>>,
    /// The gripper.
    pub gripper: Gripper,
    /// The cutter, while it is there.
    pub cutter: Option<Gripper>,
    /// The cut of [`GraspLiftRun::cut`] has been made.
    pub cut: bool,
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
    /// The organ that was cut, if any was.
    pub cut: Option<CutOrgan>,
}

impl GraspLift {
    /// Runs the task on `specimen`.
    ///
    /// # Errors
    /// Names the organ that is not there, the option out of range, or the place where nothing can be grasped.
    pub fn run(&self, specimen: &Specimen, progress: &dyn Progress) -> Result<GraspLiftRun> {
        let mut session = Session::new(self, specimen)?;
        progress.begin("simulate", session.frames() as u64);
        loop {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let calming = session.calming();
            if !session.advance()? {
                break;
            }
            progress.advance(u64::from(!calming));
        }
        progress.end();
        Ok(session.finish())
    }

    /// The organ that is grasped.
    pub(crate) fn choose_organ(&self, specimen: &Specimen) -> Result<usize> {
        let find = |name: &str| specimen.organs.iter().position(|o| o.name == name);
        match self.organ.as_deref() {
            Some(name) => find(name).ok_or_else(|| Error::UnknownOrgan {
                name: name.to_owned(),
                known: specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", "),
            }),
            None if specimen.organs.is_empty() => Err(Error::Option("the specimen has no organ".to_owned())),
            None => Ok(find("appendix").unwrap_or(0)),
        }
    }

    pub(crate) fn validate(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.at) {
            return Err(Error::Option(format!(
                "--at is {}; the organ coordinate runs from 0 (base) to 1 (tip)",
                self.at
            )));
        }
        if let Some(SeverAt::S(s)) = self.sever
            && !(0.0..=1.0).contains(&s)
        {
            return Err(Error::Option(format!("--sever is {s}; the organ coordinate runs from 0 (base) to 1 (tip)")));
        }
        if !(self.lift > 0.0 && self.lift <= 0.1) {
            return Err(Error::Option(format!("--lift is {} mm; more than 0 and at most 100 mm", self.lift * 1e3)));
        }
        if !(self.jaw_force > 0.0 && self.jaw_force <= MOST_FORCE) {
            return Err(Error::Option(format!(
                "--jaw-force is {} N; more than 0 and at most {MOST_FORCE} N",
                self.jaw_force
            )));
        }
        for (what, distance) in
            [("the approach offset", self.approach_offset), ("the drag", self.regrasp.unwrap_or(0.0))]
        {
            if !(-FARTHEST..=FARTHEST).contains(&distance) {
                let (is, most) = (distance * 1e3, FARTHEST * 1e3);
                return Err(Error::Option(format!("{what} is {is} mm; at most {most} mm to either side")));
            }
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
