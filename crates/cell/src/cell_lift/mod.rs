//! A scripted grasp-lift in the cell: an arm comes through its port, closes its jaws on an organ, lifts it 15 mm in a second and holds it for one.
//!
//! The script is a [`Policy`]: all it does goes through actions, thirty a second, and so through ports, controllers and arms. What it grasps is chosen as in [`crate::GraspLift`].

mod record;

use crate::gripper::GRIP_DISTANCE;
use crate::session::smoothstep;
use crate::target::Target;
use crate::{Action, Cell, Error, GraspDesign, Policy, Result};
use glam::{DMat3, DQuat, DVec3};
use trocar_core::{Pose, Progress};
use trocar_robot::instrument::Coordinates;
use trocar_robot::port::Solution;

use record::Record;
pub use record::{CellLiftRun, CellLiftSample, CellLiftSummary};

/// Way along the shaft from which the open jaws come [m].
const BACK: f64 = 0.025;

/// Speed on the way there [m/s].
const APPROACH_SPEED: f64 = 0.03;

/// Longest wait for the jaws to take hold [s].
const LONGEST_CLOSE: f64 = 1.5;

/// Most that the jaws may miss the place by [m]: on flat organs the blades' tips reach the cell's floor first.
const MISSED: f64 = 8e-3;

/// The task.
#[derive(Clone, Debug, PartialEq)]
pub struct CellLift {
    /// The arm.
    pub arm: String,
    /// The organ; `None`: the appendix, or else the first.
    pub organ: Option<String>,
    /// Organ coordinate of the grasp, 0 to 1.
    pub at: f64,
    /// Lift of the jaws [m].
    pub lift: f64,
    /// How the jaws hold; `None`: as they are set.
    pub design: Option<GraspDesign>,
    /// The jaws first drag the tissue sideways by this much [m], by a live-pose grasp, let go of it there and close again.
    pub regrasp: Option<f64>,
}

impl Default for CellLift {
    fn default() -> Self {
        Self { arm: "left".to_owned(), organ: None, at: 0.5, lift: 0.015, design: None, regrasp: None }
    }
}

/// Phases of the script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Settle,
    Approach,
    Enter,
    Close,
    Drag,
    Release,
    Lift,
    Hold,
}

impl Phase {
    fn name(self) -> &'static str {
        match self {
            Self::Settle => "settle",
            Self::Approach => "approach",
            Self::Enter => "enter",
            Self::Close => "close",
            Self::Drag => "drag",
            Self::Release => "release",
            Self::Lift => "lift",
            Self::Hold => "hold",
        }
    }

    fn seconds(self) -> f64 {
        match self {
            Self::Close => LONGEST_CLOSE,
            Self::Drag | Self::Release => 0.6,
            Self::Settle | Self::Approach | Self::Enter | Self::Lift | Self::Hold => 1.0,
        }
    }
}

/// A [`CellLift`] as a policy.
#[derive(Clone, Debug)]
pub struct CellLiftPolicy {
    task: CellLift,
    organ: usize,
    arm: usize,
    phases: Vec<Phase>,
    phase: usize,
    /// Control periods of the phase that are over, and as many as it has.
    done: usize,
    count: usize,
    /// Where the phase began, and where the jaws grasp.
    from: Coordinates,
    grasp: Option<(Pose, Coordinates)>,
    /// The design after a drag.
    design: GraspDesign,
}

impl CellLiftPolicy {
    /// The task as a policy for `cell`.
    ///
    /// # Errors
    /// Names the arm or organ that is not there, or the option out of range.
    pub fn new(task: &CellLift, cell: &Cell) -> Result<Self> {
        task.validate()?;
        let bodies = cell.world().model.bodies();
        let find = |name: &str| bodies.iter().position(|b| b.name() == name);
        let organ = match task.organ.as_deref() {
            Some(name) => find(name).ok_or_else(|| Error::UnknownOrgan {
                name: name.to_owned(),
                known: bodies.iter().map(|b| b.name()).collect::<Vec<_>>().join(", "),
            })?,
            None => find("appendix").unwrap_or(0),
        };
        let arm = cell.arm_index(&task.arm)?;
        let mut phases = vec![Phase::Settle, Phase::Approach, Phase::Enter, Phase::Close];
        if task.regrasp.is_some() {
            phases.extend([Phase::Drag, Phase::Release, Phase::Close]);
        }
        phases.extend([Phase::Lift, Phase::Hold]);
        let from = cell.setpoint(&task.arm)?;
        let design = task.design.unwrap_or_default();
        Ok(Self { task: task.clone(), organ, arm, phases, phase: 0, done: 0, count: 0, from, grasp: None, design })
    }

    /// Name of the phase that goes on; empty when all are over.
    pub fn phase(&self) -> &'static str {
        self.phases.get(self.phase).map_or("", |p| p.name())
    }

    fn dragging(&self) -> bool {
        self.phases[self.phase..].contains(&Phase::Drag)
    }

    /// The design with which the jaws are to close next.
    pub fn design(&self) -> GraspDesign {
        if self.dragging() { GraspDesign::LivePose } else { self.design }
    }

    fn enter(&mut self, phase: Phase, cell: &Cell) -> Result<()> {
        self.from = cell.setpoint(&self.task.arm)?;
        let mut seconds = phase.seconds();
        if phase == Phase::Approach {
            let (pose, coordinates) = self.choose(cell)?;
            self.grasp = Some((pose, coordinates));
            let way = cell.port(&self.task.arm)?.tip(&self.from).translation.distance(pose.translation);
            seconds = seconds.max(1.5 * way / APPROACH_SPEED);
        }
        self.count = (seconds / cell.period()).round() as usize;
        Ok(())
    }

    /// The tip's pose with the tissue in mid-mouth, the shaft through its port, the jaws across the organ; and its coordinates.
    fn choose(&self, cell: &Cell) -> Result<(Pose, Coordinates)> {
        let (world, arm) = (cell.world(), &self.task.arm);
        let target = Target::choose(world, self.organ, self.task.at, 0.0)?;
        let axis = &world.axes[self.organ];
        let s = target.cluster.s;
        let along = axis.point_at((s + 0.05).min(1.0)) - axis.point_at((s - 0.05).max(0.0));
        let at = target.cluster.centroid(world, self.organ);
        let x = (at - cell.port(arm)?.centre()).normalize_or(-DVec3::Z);
        let hinge = (along - along.dot(x) * x).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
        let pose = |z: DVec3| {
            let rotation = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
            Pose { rotation, translation: at - GRIP_DISTANCE * x }
        };
        // The blades are alike: of the two ways round, the one that the wrist reaches with less of a turn.
        let near = Coordinates { jaw: 1.0, ..self.from };
        let turn = |s: &Solution| (s.coordinates.roll - near.roll).abs() + 10.0 * s.excess.roll.abs();
        let (a, b) = (cell.solve(arm, &pose(hinge), &near)?, cell.solve(arm, &pose(-hinge), &near)?);
        let best = if turn(&a) <= turn(&b) { a } else { b };
        if best.rejected_translation.length() > MISSED {
            return Err(Error::Option(format!(
                "the {arm} arm does not reach the tissue at s = {s:.2}: its tip stays {:.1} mm away; grasp elsewhere or move the port",
                1e3 * best.rejected_translation.length()
            )));
        }
        Ok((best.tip, best.coordinates))
    }

    /// Where the arm is to be when `share` of the phase is over.
    fn target(&self, phase: Phase, share: f64, cell: &Cell) -> Result<Coordinates> {
        let eased = smoothstep(share.min(1.0));
        let Some((pose, grasp)) = &self.grasp else { return Ok(Coordinates { jaw: 1.0, ..self.from }) };
        let low = cell.limits(&self.task.arm)?.insertion[0];
        let back = Coordinates { insertion: (grasp.insertion - BACK).max(low), jaw: 1.0, ..*grasp };
        let open = Coordinates { jaw: 1.0, ..*grasp };
        let beside = |by: DVec3, jaw: f64| -> Result<Coordinates> {
            let tip = Pose { translation: pose.translation + by, ..*pose };
            Ok(Coordinates { jaw, ..cell.solve(&self.task.arm, &tip, grasp)?.coordinates })
        };
        let aside = pose.rotation * (self.task.regrasp.unwrap_or(0.0) * DVec3::Y);
        let dragged = if self.dragging() { DVec3::ZERO } else { aside };
        match phase {
            Phase::Settle => Ok(Coordinates { jaw: 1.0, ..self.from }),
            Phase::Approach => Ok(between(&self.from, &back, eased)),
            Phase::Enter => Ok(between(&back, &open, eased)),
            Phase::Close => beside(dragged, 0.0),
            Phase::Drag => beside(eased * aside, 0.0),
            Phase::Release => beside(aside, 0.6),
            Phase::Lift => beside(dragged + eased * self.task.lift * DVec3::Z, 0.0),
            Phase::Hold => beside(dragged + self.task.lift * DVec3::Z, 0.0),
        }
    }
}

impl Policy for CellLiftPolicy {
    fn act(&mut self, cell: &Cell) -> Result<Option<Action>> {
        let Some(&phase) = self.phases.get(self.phase) else { return Ok(None) };
        if self.done == 0 {
            self.enter(phase, cell)?;
        }
        self.done += 1;
        let target = self.target(phase, self.done as f64 / self.count as f64, cell)?;
        let mut all = Vec::new();
        for (k, arm) in cell.observe().iter().enumerate() {
            all.push(if k == self.arm { target } else { arm.commanded });
        }
        // Jaws that have hold of something need not be waited for.
        let closed = phase == Phase::Close && cell.held(&self.task.arm)?.is_some();
        if self.done >= self.count || closed {
            (self.phase, self.done) = (self.phase + 1, 0);
        }
        Ok(Some(Action::pivots(&all)))
    }
}

fn between(from: &Coordinates, to: &Coordinates, share: f64) -> Coordinates {
    let mix = |a: f64, b: f64| a + share * (b - a);
    Coordinates {
        pivots: [mix(from.pivots[0], to.pivots[0]), mix(from.pivots[1], to.pivots[1])],
        insertion: mix(from.insertion, to.insertion),
        roll: mix(from.roll, to.roll),
        jaw: to.jaw,
    }
}

impl CellLift {
    /// Runs the task in `cell`.
    ///
    /// # Errors
    /// Names the arm or organ that is not there, the option out of range, the place that cannot be grasped; an interruption.
    pub fn run(&self, cell: &mut Cell, progress: &dyn Progress) -> Result<CellLiftRun> {
        self.run_watched(cell, progress, &mut |_, _| {})
    }

    /// The same, with `watch` shown the cell and the phase's name before the first period and after each.
    ///
    /// # Errors
    /// As [`CellLift::run`].
    pub fn run_watched(
        &self,
        cell: &mut Cell,
        progress: &dyn Progress,
        watch: &mut dyn FnMut(&Cell, &'static str),
    ) -> Result<CellLiftRun> {
        let mut policy = CellLiftPolicy::new(self, cell)?;
        if self.design.is_none() {
            policy.design = cell.grasp_design(&self.arm)?;
        }
        let mut record = Record::new(self, &policy);
        let before = cell.timing().all;
        progress.begin("simulate", 1);
        watch(cell, policy.phase());
        loop {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let phase = policy.phase();
            cell.set_grasp_design(&self.arm, policy.design())?;
            let Some(action) = policy.act(cell)? else { break };
            let report = cell.step(&action)?;
            record.add(phase, &report, cell)?;
            watch(cell, phase);
            if record.summary.diverged {
                break;
            }
        }
        progress.end();
        let wall = (cell.timing().all - before).as_secs_f64();
        Ok(record.finish(policy.design.name(), wall, cell.hash()))
    }

    fn validate(&self) -> Result<()> {
        let within = |name: &str, value: f64, low: f64, high: f64, unit: &str| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::Option(format!("{name} is {value}{unit}; {low} to {high}{unit}")))
        };
        within("--at", self.at, 0.0, 1.0, "")?;
        within("--lift", 1e3 * self.lift, 0.1, 60.0, " mm")?;
        within("--regrasp", 1e3 * self.regrasp.unwrap_or(0.0), -30.0, 30.0, " mm")
    }
}
