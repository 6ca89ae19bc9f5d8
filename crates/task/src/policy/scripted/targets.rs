//! Where the arms go in each phase of the script, and how long they take.

use super::super::aim::{self, Manner, Place};
use super::super::cut_place::cut_place;
use super::super::phase::Phase;
use super::super::script::{AfterHold, CutAt};
use super::transitions::RISE;
use super::{Scripted, Style, seen};
use crate::{Episode, Error, Result};
use glam::DVec3;
use trocar_cell::Setpoint;
use trocar_core::Pose;

/// Way along the shaft from which open jaws come (m).
const BACK: f64 = 0.025;

/// Way along the shaft by which a cutter draws back after a cut (m).
const WITHDRAWN: f64 = 0.060;

/// How far the jaws rise with a piece that was cut free (m), the time of that, and how long they
/// stay there (s).
const CARRY: f64 = 0.010;
const CARRY_S: f64 = 1.0;
const KEEP_S: f64 = 0.5;

/// Way along the shaft by which open blades back out of tissue that presses them apart, at most
/// (m), and their speed (m/s).
const BACK_OUT: f64 = 0.008;
const BACK_OUT_SPEED: f64 = 0.010;

/// Way by which jaws that tissue keeps open back off (m), and its time (s). Where one blade alone
/// presses on something, they go as far to the side of the other blade.
const BACK_OFF: f64 = 0.0015;
const BACK_OFF_S: f64 = 0.3;

/// Speed of the tips on the way there, and close to tissue (m/s).
const FAST: f64 = 0.04;
const SLOW: f64 = 0.025;

/// The cutter takes tissue this far from the pivot (m), where the gap of nearly closed blades is
/// still wider than their contact skin.
const CUT_DEPTH: f64 = 0.0140;

/// Way along the organ from the middle of the grasp to the cut (m): half of a grasper's blade and
/// half of a cutter's, and as much between them as either jaw's aim may be off.
const BESIDE: f64 = 0.0060;

/// Time of the lift (s), and of waiting for jaws to take hold or to close.
const LIFT_S: f64 = 1.5;
const CLOSE_S: f64 = 1.5;

/// Time of a lift that a [`Script`] asks for, of its hold and of lowering (s).
const SCRIPT_LIFT_S: f64 = 1.0;
const SCRIPT_HOLD_S: f64 = 1.0;

/// Time of dragging, letting go and opening (s), and how wide jaws open to let go of dragged
/// tissue.
const DRAG_S: f64 = 0.6;
const OPEN_S: f64 = 0.5;
const RELEASE_JAW: f64 = 0.6;

/// Speed of the greedy style over that of the careful one, and the time it gives the jaws to close
/// (s): a little more than they need on nothing.
const HASTE: f64 = 3.0;
const SNATCH_S: f64 = 0.4;

/// The cutter closes to this share of the gate's opening.
const CLOSED: f64 = 0.75;

/// Lift of the jaws (m) above the gate's.
const ABOVE_GATE: f64 = 0.0025;

/// Time of a further step of the lift (s).
const RISE_S: f64 = 0.2;

impl Scripted {
    /// Organ coordinate at which the cutter cuts: beside the grasp, towards the base. Farther on,
    /// an appendix whose base is held is pinned, and pinned tissue feels no blade.
    fn cut_at(&self, episode: &Episode, body: usize) -> Result<f64> {
        match self.script.map(|script| script.after) {
            Some(AfterHold::Cut(CutAt::S(s))) => Ok(s),
            Some(AfterHold::Cut(CutAt::Between)) => cut_place(episode, body),
            _ => {
                let grasp = self.grasp.as_ref().map_or(0.5, |g| g.s);
                let length = episode.cell().world().axes[body].length.max(1e-3);
                Ok(grasp - (BESIDE / length).min(0.5 * grasp))
            }
        }
    }

    /// Sends the grasper's tip to the aim moved by `by` (m, cell).
    fn send_beside(&mut self, episode: &Episode, arm: &str, by: DVec3) -> Result<()> {
        let (Some(k), Some(aim)) = (episode.roles().0, &self.grasp) else { return Ok(()) };
        let tip = Pose { translation: aim.pose.translation + by, ..aim.pose };
        self.to[k] = episode.cell().solve(arm, &tip, &aim.setpoint)?.setpoint.with_jaw(0.0);
        Ok(())
    }

    /// Enters the phase: says where the arms go and for how many periods.
    pub(super) fn enter(&mut self, episode: &Episode) -> Result<()> {
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
                let (place, aside) = match &self.script {
                    Some(script) => (Place::At(script.at), script.approach_offset),
                    None => (Place::InRange([gates.grasp_from, gates.grasp_to], self.outward), 0.0),
                };
                self.backs = 0;
                let aim = aim::grasp(cell, arms[k], body, (place, Manner::Fitting), aside)?;
                self.grasp = Some(aim);
                let open = aim.setpoint;
                let behind = || Ok::<_, Error>(cell.workspace(arms[k])?.behind(&open, BACK));
                self.to[k] = if self.phase == Phase::Approach { behind()? } else { open };
                self.time(episode, k, if self.phase == Phase::Approach { FAST } else { SLOW })?
            }
            Phase::BackOut => {
                let Some(k) = grasper else { return Ok(()) };
                self.to[k] = cell.workspace(arms[k])?.behind(&self.from[k], BACK_OUT);
                self.time(episode, k, BACK_OUT_SPEED)?
            }
            Phase::BackOff => {
                let (Some(k), Some(aim)) = (grasper, self.grasp) else { return Ok(()) };
                let workspace = cell.workspace(arms[k])?;
                let mut to = workspace.behind(&self.from[k], BACK_OFF);
                if let Some(side) = self.lone_blade(episode) {
                    let tip = workspace.tip(&to);
                    let translation = tip.translation - side * BACK_OFF * (tip.rotation * DVec3::Y);
                    to = cell.solve(arms[k], &Pose { translation, ..tip }, &to)?.setpoint;
                }
                self.to[k] = to.with_jaw(aim.setpoint.jaw());
                BACK_OFF_S
            }
            Phase::Close => {
                if let Some(k) = grasper {
                    self.to[k] = self.to[k].with_jaw(0.0);
                    self.from[k] = self.from[k].with_jaw(0.0);
                }
                self.grip.begin(self.grasp.is_some_and(|aim| aim.folds));
                close
            }
            Phase::Drag => {
                let (Some(k), Some(aim), Some(script)) = (grasper, &self.grasp, &self.script) else { return Ok(()) };
                let by = aim.pose.rotation * (script.regrasp.unwrap_or(0.0) * DVec3::Y);
                let aim = aim::beside(cell, arms[k], aim, by)?;
                self.to[k] = aim.setpoint.with_jaw(0.0);
                (self.grasp, self.dragged) = (Some(aim), true);
                DRAG_S
            }
            Phase::Release | Phase::Open => {
                let jaw = if self.phase == Phase::Open { 1.0 } else { RELEASE_JAW };
                if let Some(k) = grasper {
                    self.to[k] = self.to[k].with_jaw(jaw);
                }
                if self.phase == Phase::Open { OPEN_S } else { DRAG_S }
            }
            Phase::Lift => {
                let Some(k) = grasper else { return Ok(()) };
                let gate = 1e-3 * episode.scene().task.gates.lift_mm + ABOVE_GATE;
                self.lift = self.script.map_or(gate, |script| script.lift);
                self.send_beside(episode, arms[k], self.lift * DVec3::Z)?;
                if self.script.is_some() { SCRIPT_LIFT_S } else { LIFT_S }
            }
            Phase::Rise => {
                let Some(k) = grasper else { return Ok(()) };
                self.risen_mm = seen(episode).task.lift_mm;
                self.lift += RISE;
                self.send_beside(episode, arms[k], self.lift * DVec3::Z)?;
                RISE_S
            }
            Phase::Hold if self.script.is_some() => SCRIPT_HOLD_S,
            Phase::Hold => episode.scene().task.gates.lift_s + 0.2,
            Phase::Lower => {
                let Some(k) = grasper else { return Ok(()) };
                self.send_beside(episode, arms[k], DVec3::ZERO)?;
                SCRIPT_LIFT_S
            }
            Phase::Reach | Phase::Engage => {
                let Some(k) = cutter else { return Err(Error::Option("scripted needs a cutter".into())) };
                let body = self.body(episode)?;
                let s = self.cut_at(episode, body)?;
                let point = aim::middle(cell, body, s).unwrap_or(DVec3::ZERO);
                // Deeper with every try.
                let depth = CUT_DEPTH - 1.5e-3 * self.tries as f64;
                let open = aim::at(cell, arms[k], body, s, point, depth)?.setpoint.with_jaw(1.0);
                let behind = || Ok::<_, Error>(cell.workspace(arms[k])?.behind(&open, BACK));
                self.to[k] = if self.phase == Phase::Reach { behind()? } else { open };
                self.time(episode, k, if self.phase == Phase::Reach { FAST } else { SLOW })?
            }
            Phase::Cut => {
                if let Some(k) = cutter {
                    self.to[k] = self.to[k].with_jaw(CLOSED * episode.scene().task.gates.cut_closed);
                    self.from[k] = self.from[k].with_jaw(self.to[k].jaw());
                }
                close
            }
            Phase::Carry => {
                if let Some(k) = cutter {
                    self.to[k] = cell.workspace(arms[k])?.behind(&self.to[k], WITHDRAWN);
                }
                if let Some(k) = grasper.filter(|k| is_free(episode, *k)) {
                    self.send_beside(episode, arms[k], (self.lift + CARRY) * DVec3::Z)?;
                }
                CARRY_S
            }
            Phase::Keep => KEEP_S,
            Phase::Target(n) => {
                let mut seconds: f64 = 0.0;
                for (k, targets) in episode.targets().iter().enumerate() {
                    let pose = cell.measured_cp(arms[k])?;
                    let length = cell.blade_tip(arms[k])?.distance(pose.translation);
                    let x = cell.workspace(arms[k])?.direction_to(targets[n]);
                    let tip = Pose { translation: targets[n] - length * x, ..pose };
                    let reached = cell.solve(arms[k], &tip, &self.from[k])?.setpoint;
                    self.to[k] = reached.with_roll(self.from[k].roll()).with_jaw(self.from[k].jaw());
                    seconds = seconds.max(self.time(episode, k, FAST)?);
                }
                seconds + 0.8
            }
            Phase::Rest | Phase::Finished => 1.0,
        };
        self.count = ((seconds / speed / cell.period()).round() as usize).max(1);
        Ok(())
    }

    /// Time of arm `k` on its way at a mean of two thirds of `speed` (m/s).
    fn time(&self, episode: &Episode, k: usize, speed: f64) -> Result<f64> {
        let cell = episode.cell();
        let workspace = cell.workspace(cell.arms()[k].0.name())?;
        let tip = |c: &Setpoint| workspace.tip(c).translation;
        let way = tip(&self.from[k]).distance(tip(&self.to[k]));
        let turn = (self.from[k].roll() - self.to[k].roll()).abs();
        Ok((1.5 * way / speed).max(turn).max(0.3))
    }
}

/// Whether what the arm at place `k` holds hangs on nothing that is pinned.
fn is_free(episode: &Episode, k: usize) -> bool {
    let bodies = episode.cell().world().model.bodies();
    episode.cell().carried(k).is_some_and(|held| !bodies[held.organ].pinned().contains(&true))
}
