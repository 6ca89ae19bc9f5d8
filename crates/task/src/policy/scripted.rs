//! The scripted finite-state baseline (SPEC E3): grasp at the organ's middle, lift, bring the cutter to the tissue between grasp and base, open, engage, close.
//!
//! It looks at where the tissue is, which no policy that is scored may; all it does goes through actions, and so through ports, controllers and arms.

use super::aim::{self, Aim, between, eased};
use super::{CHUNK, Policy};
use crate::{Episode, Error, Result};
use glam::DVec3;
use trocar_cell::Action;
use trocar_core::Pose;
use trocar_robot::instrument::Coordinates;
use trocar_scene::TaskName;

/// Way along the shaft from which open jaws come [m].
const BACK: f64 = 0.025;

/// Speed of the tips on the way there, and close to tissue [m/s].
const FAST: f64 = 0.04;
const SLOW: f64 = 0.025;

/// Tissue is taken this far from the pivot: in mid-mouth by the grasper [m] ...
const GRASP_DEPTH: f64 = 0.0115;
/// ... and farther out by the cutter, where the gap of nearly closed blades is still wider than their skin (SPEC C3).
const CUT_DEPTH: f64 = 0.0140;

/// Way along the organ from the middle of the grasp to the cut [m]: half of a grasper's blade and half of a cutter's, and as much between them as either jaw's aim may be off.
const BESIDE: f64 = 0.0060;

/// Lift of the jaws [m] above what the gate asks for.
const ABOVE_GATE: f64 = 0.0025;

/// Time of the lift [s], and of waiting for jaws to take hold or to close.
const LIFT_S: f64 = 1.5;
const CLOSE_S: f64 = 1.5;

/// Speed of the greedy one over that of the careful one, and the time that it gives jaws to close [s]: what they take on nothing and a little more.
const HASTE: f64 = 3.0;
const SNATCH_S: f64 = 0.4;

/// The cutter closes to this share of the gate's opening.
const CLOSED: f64 = 0.75;

/// Times that it tries again to grasp, and to cut.
const TRIES: usize = 3;

/// How it goes about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Comes along the shaft, waits for what it has begun, tries again.
    Careful,
    /// Straight to everything at three times the speed, open loop: no way round, no looking whether jaws have taken hold or the lift has lasted, no second try.
    Greedy,
}

/// What it is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Approach,
    Enter,
    Close,
    Lift,
    Hold,
    Reach,
    Engage,
    Cut,
    /// Port-reach: both arms to target number so.
    Target(usize),
    Rest,
}

/// The baseline.
#[derive(Clone, Debug)]
pub struct Scripted {
    style: Style,
    name: &'static str,
    phase: Phase,
    /// Periods of the phase that are over, and as many as it has; 0: it is to be entered.
    done: usize,
    count: usize,
    /// Where each arm goes from and to in this phase.
    from: Vec<Coordinates>,
    to: Vec<Coordinates>,
    /// What it asked of each arm last. Not what the cell was told: who changes its actions on the way must not shift where its next phase begins, or a constant offset grows with every phase.
    last: Vec<Coordinates>,
    /// The grasp, as it was aimed at.
    grasp: Option<Aim>,
    lift: f64,
    tries: usize,
}

impl Scripted {
    /// Before its first episode.
    pub fn new(style: Style) -> Self {
        let name = match style {
            Style::Careful => "scripted",
            Style::Greedy => "greedy",
        };
        let [from, to, last] = [const { Vec::new() }; 3];
        Self { style, name, phase: Phase::Rest, done: 0, count: 0, from, to, last, grasp: None, lift: 0.0, tries: 0 }
    }

    /// Organ coordinate at which the cutter cuts: beside the grasp, towards the base. Farther on, an appendix whose base is held is pinned, and pinned tissue feels no blade.
    fn cut_at(&self, episode: &Episode, body: usize) -> f64 {
        let grasp = self.grasp.as_ref().map_or(0.5, |g| g.s);
        let length = episode.cell().world().axes[body].length.max(1e-3);
        grasp - (BESIDE / length).min(0.5 * grasp)
    }

    fn body(&self, episode: &Episode) -> Result<usize> {
        let bodies = episode.bodies();
        bodies.first().copied().ok_or_else(|| Error::Option("the scene has no organ to grasp".to_owned()))
    }

    fn go(&mut self, phase: Phase) {
        (self.phase, self.done, self.count) = (phase, 0, 0);
    }

    /// Enters the phase: says where the arms go and for how many periods.
    fn enter(&mut self, episode: &Episode) -> Result<()> {
        let cell = episode.cell();
        let arms: Vec<&str> = cell.arms().iter().map(|(side, _)| side.name()).collect();
        self.from = match self.last.len() == arms.len() {
            true => self.last.clone(),
            false => arms.iter().map(|arm| cell.setpoint(arm)).collect::<std::result::Result<_, _>>()?,
        };
        self.to = self.from.clone();
        let (grasper, cutter) = episode.roles();
        let greedy = self.style == Style::Greedy;
        let speed = if greedy { HASTE } else { 1.0 };
        let close = if greedy { HASTE * SNATCH_S } else { CLOSE_S };
        let seconds = match self.phase {
            Phase::Approach | Phase::Enter => {
                let Some(k) = grasper else { return Err(Error::Option("scripted needs a grasper".into())) };
                let body = self.body(episode)?;
                let gates = &episode.scene().task.gates;
                let range = [gates.grasp_from, gates.grasp_to];
                let aim = aim::grasp(cell, arms[k], body, 0.5 * (range[0] + range[1]), range, GRASP_DEPTH)?;
                self.grasp = Some(aim);
                let open = Coordinates { jaw: 1.0, ..aim.coordinates };
                self.to[k] = if self.phase == Phase::Approach { behind(cell, arms[k], &open)? } else { open };
                self.time(episode, k, if self.phase == Phase::Approach { FAST } else { SLOW })?
            }
            Phase::Close => {
                if let Some(k) = grasper {
                    self.to[k].jaw = 0.0;
                    self.from[k].jaw = 0.0;
                }
                close
            }
            Phase::Lift => {
                let (Some(k), Some(aim)) = (grasper, &self.grasp) else { return Ok(()) };
                self.lift = 1e-3 * episode.scene().task.gates.lift_mm + ABOVE_GATE;
                let tip = Pose { translation: aim.pose.translation + self.lift * DVec3::Z, ..aim.pose };
                let solved = cell.solve(arms[k], &tip, &aim.coordinates)?.coordinates;
                self.to[k] = Coordinates { jaw: 0.0, ..solved };
                LIFT_S
            }
            Phase::Hold => episode.scene().task.gates.lift_s + 0.2,
            Phase::Reach | Phase::Engage => {
                let Some(k) = cutter else { return Err(Error::Option("scripted needs a cutter".into())) };
                let body = self.body(episode)?;
                let s = self.cut_at(episode, body);
                let point = aim::middle(cell, body, s).unwrap_or(DVec3::ZERO);
                // Deeper with every try.
                let depth = CUT_DEPTH - 1.5e-3 * self.tries as f64;
                let open = Coordinates { jaw: 1.0, ..aim::at(cell, arms[k], body, s, point, depth)?.coordinates };
                self.to[k] = if self.phase == Phase::Reach { behind(cell, arms[k], &open)? } else { open };
                self.time(episode, k, if self.phase == Phase::Reach { FAST } else { SLOW })?
            }
            Phase::Cut => {
                if let Some(k) = cutter {
                    self.to[k].jaw = CLOSED * episode.scene().task.gates.cut_closed;
                    self.from[k].jaw = self.to[k].jaw;
                }
                close
            }
            Phase::Target(n) => {
                let mut seconds: f64 = 0.0;
                for (k, targets) in episode.targets().iter().enumerate() {
                    let pose = cell.measured_cp(arms[k])?;
                    let length = cell.blade_tip(arms[k])?.distance(pose.translation);
                    let x = (targets[n] - cell.port(arms[k])?.centre()).normalize_or(-DVec3::Z);
                    let tip = Pose { translation: targets[n] - length * x, ..pose };
                    let roll = self.from[k].roll;
                    self.to[k] = Coordinates { roll, ..cell.solve(arms[k], &tip, &self.from[k])?.coordinates };
                    self.to[k].jaw = self.from[k].jaw;
                    seconds = seconds.max(self.time(episode, k, FAST)?);
                }
                seconds + 0.8
            }
            Phase::Rest => 1.0,
        };
        self.count = ((seconds / speed / cell.period()).round() as usize).max(1);
        Ok(())
    }

    /// Time of arm `k` on its way at a mean of two thirds of `speed` [m/s].
    fn time(&self, episode: &Episode, k: usize, speed: f64) -> Result<f64> {
        let cell = episode.cell();
        let port = cell.port(cell.arms()[k].0.name())?;
        let tip = |c: &Coordinates| port.tip(c).translation;
        let way = tip(&self.from[k]).distance(tip(&self.to[k]));
        let turn = (self.from[k].roll - self.to[k].roll).abs();
        Ok((1.5 * way / speed).max(turn).max(0.3))
    }

    /// What comes after the phase, looking at the episode as it is now.
    fn next(&mut self, episode: &Episode) {
        let channels = episode.rows().last().copied().unwrap_or_default();
        let (t, careful) = (channels.task, self.style == Style::Careful);
        let again = careful && self.tries < TRIES;
        let task = episode.scene().task.name;
        let next = match self.phase {
            Phase::Approach => Phase::Enter,
            Phase::Enter => Phase::Close,
            Phase::Close if t.grasped == 0.0 && again => {
                self.tries += 1;
                Phase::Approach
            }
            Phase::Close => Phase::Lift,
            Phase::Lift if !careful && task != TaskName::GraspLift => Phase::Reach,
            Phase::Lift => Phase::Hold,
            Phase::Hold if t.grasped == 0.0 && again => {
                self.tries += 1;
                Phase::Approach
            }
            Phase::Hold if task == TaskName::GraspLift => Phase::Rest,
            Phase::Hold => {
                self.tries = 0;
                Phase::Reach
            }
            Phase::Reach => Phase::Engage,
            Phase::Engage if t.cut_mouth == 0.0 && again => {
                self.tries += 1;
                Phase::Engage
            }
            Phase::Engage => Phase::Cut,
            Phase::Cut if again => {
                self.tries += 1;
                Phase::Reach
            }
            Phase::Cut => Phase::Rest,
            Phase::Target(n) if n < 2 => Phase::Target(n + 1),
            Phase::Target(_) | Phase::Rest => Phase::Rest,
        };
        self.go(next);
    }

    /// Whether the phase is over before its time.
    fn early(&self, episode: &Episode) -> bool {
        let t = episode.rows().last().copied().unwrap_or_default().task;
        self.style == Style::Careful && self.phase == Phase::Close && t.grasped > 0.0 && self.done > 0
    }

    fn action(&mut self, episode: &Episode) -> Result<Action> {
        if self.count == 0 {
            self.enter(episode)?;
        }
        self.done += 1;
        let share = eased(self.done as f64 / self.count as f64);
        let targets: Vec<Coordinates> = self.from.iter().zip(&self.to).map(|(a, b)| between(a, b, share)).collect();
        let limits = episode.cell().arms().into_iter().map(|(side, _)| episode.cell().limits(side.name()));
        let limits: Vec<_> = limits.collect::<std::result::Result<_, _>>()?;
        let kept: Vec<Coordinates> = targets.iter().zip(limits).map(|(c, l)| l.clamp(c).0).collect();
        let action = Action::pivots(&kept);
        self.last = kept;
        Ok(action)
    }
}

/// The same place, but farther out along the shaft.
fn behind(cell: &trocar_cell::Cell, arm: &str, at: &Coordinates) -> Result<Coordinates> {
    let low = cell.limits(arm)?.insertion[0];
    Ok(Coordinates { insertion: (at.insertion - BACK).max(low), ..*at })
}

impl Policy for Scripted {
    fn name(&self) -> &str {
        self.name
    }

    fn begin(&mut self, episode: &Episode, _seed: u64) -> Result<()> {
        *self = Self::new(self.style);
        let greedy = self.style == Style::Greedy;
        self.go(match episode.scene().task.name {
            TaskName::PortReach => Phase::Target(0),
            _ if greedy => Phase::Enter,
            _ => Phase::Approach,
        });
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let mut chunk = Vec::with_capacity(CHUNK);
        if self.early(episode) {
            self.next(episode);
        }
        while chunk.len() < CHUNK {
            if self.count > 0 && self.done >= self.count {
                // What comes next is decided by what is seen, so a chunk ends with its phase.
                if !chunk.is_empty() {
                    break;
                }
                self.next(episode);
                if self.style == Style::Greedy && self.phase == Phase::Reach {
                    self.phase = Phase::Engage;
                }
            }
            chunk.push(self.action(episode)?);
        }
        Ok(chunk)
    }
}
