//! The scripted finite-state baseline: grasp at the organ's middle, lift, bring the cutter to the
//! tissue between grasp and base, open, engage, close. With a [`Script`], place and height of the
//! lift are those of the script, and afterwards it lowers or cuts the tissue.
//!
//! The jaws close as far as the tissue between them allows ([`Grip`]). Without a script they rise
//! until the tissue has risen. If it does not rise, they lower it, release it and grasp again,
//! farther from the organ's attachment.
//!
//! It looks at where the tissue is, which no policy that is scored may. All it does goes through
//! actions, and so through controllers, arms and ports where there are any.

use super::aim::{self, Aim, Manner, Place, eased};
use super::cut_place::cut_place;
use super::grip::Grip;
use super::phase::Phase;
use super::script::{AfterHold, CutAt, Script};
use super::{CHUNK, Policy};
use crate::judge::{Context, Memory};
use crate::{Channels, Episode, Error, Result};
use glam::DVec3;
use trocar_cell::{Action, Setpoint};
use trocar_core::Pose;
use trocar_scene::{Condition, TaskName};

/// Way along the shaft from which open jaws come (m).
const BACK: f64 = 0.025;

/// Way along the shaft by which a cutter draws back after a cut (m).
const WITHDRAWN: f64 = 0.060;

/// How far the jaws rise with a piece that was cut free (m), the time of that, and how long they
/// stay there (s).
const CARRY: f64 = 0.010;
const CARRY_S: f64 = 1.0;
const KEEP_S: f64 = 0.5;

/// Speed of the tips on the way there, and close to tissue (m/s).
const FAST: f64 = 0.04;
const SLOW: f64 = 0.025;

/// The cutter takes tissue this far from the pivot (m), where the gap of nearly closed blades is
/// still wider than their contact skin.
const CUT_DEPTH: f64 = 0.0140;

/// Way along the organ from the middle of the grasp to the cut (m): half of a grasper's blade and
/// half of a cutter's, and as much between them as either jaw's aim may be off.
const BESIDE: f64 = 0.0060;

/// Open blades go no deeper where tissue presses them apart with this share of the jaws' force: they
/// could not close. From the smaller share on the force is watched every period.
const MAX_SPREAD: f64 = 0.8;
const WATCHED_SPREAD: f64 = 0.2;

/// Lift of the jaws (m) above the gate's.
const ABOVE_GATE: f64 = 0.0025;

/// The jaws lift until the tissue has risen by the gate's lift and this (m).
const ENOUGH_ABOVE: f64 = 0.0005;

/// They continue in steps of this height (m) and time (s), up to this lift above the gate (m),
/// while tissue follows this share of a step.
const RISE: f64 = 0.001;
const RISE_S: f64 = 0.2;
const MAX_ABOVE: f64 = 0.008;
const RISES: f64 = 0.25;

/// Every further grasp is this much farther from where the organ is held, in organ coordinates.
const OUTWARD: f64 = 0.12;

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

/// Times that it tries again to grasp, and to cut.
const TRIES: usize = 3;

/// The stages that say when held tissue is up: until all of their conditions hold, it grasps again.
const LIFTED: [&str; 2] = ["lift", "held"];

/// How it goes about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// Comes along the shaft, waits for what it has begun, tries again.
    #[default]
    Careful,
    /// Straight to everything at three times the speed, open loop: no way round, no looking whether
    /// jaws have taken hold or the lift has lasted, no second try.
    Greedy,
}

/// The baseline.
#[derive(Clone, Debug)]
pub struct Scripted {
    style: Style,
    script: Option<Script>,
    name: &'static str,
    phase: Phase,
    /// Periods of the phase that are over, and as many as it has; 0: it is to be entered.
    done: usize,
    count: usize,
    /// Where each arm goes from and to in this phase.
    from: Vec<Setpoint>,
    to: Vec<Setpoint>,
    /// The last setpoint that the policy commanded to each arm. Not what the cell was commanded:
    /// who changes its actions on the way must not shift where its next phase begins, or a constant
    /// offset grows with every phase.
    last: Vec<Setpoint>,
    /// The grasp, as it was aimed at.
    grasp: Option<Aim>,
    lift: f64,
    tries: usize,
    dragged: bool,
    grip: Grip,
    /// How much farther from where the organ is held than its middle it grasps, in organ
    /// coordinates.
    outward: f64,
    /// Rise of the tissue (mm) when the last step of the lift began.
    risen_mm: f64,
}

impl Scripted {
    /// Before its first episode.
    pub fn new(style: Style) -> Self {
        let name = match style {
            Style::Careful => "scripted",
            Style::Greedy => "greedy",
        };
        let [from, to, last] = [const { Vec::new() }; 3];
        Self {
            style,
            script: None,
            name,
            phase: Phase::Rest,
            done: 0,
            count: 0,
            from,
            to,
            last,
            grasp: None,
            lift: 0.0,
            tries: 0,
            dragged: false,
            grip: Grip::default(),
            outward: 0.0,
            risen_mm: 0.0,
        }
    }

    /// One that follows `script`.
    pub fn following(script: Script) -> Self {
        Self { script: Some(script), ..Self::new(Style::Careful) }
    }

    /// Name of the phase that it is in.
    pub fn phase(&self) -> &'static str {
        self.phase.name()
    }

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

    /// The body to be grasped or cut: of a cut organ the piece that kept its name.
    fn body(&self, episode: &Episode) -> Result<usize> {
        let bodies = episode.bodies();
        bodies.first().copied().ok_or_else(|| Error::Option("the scene has no organ to grasp".to_owned()))
    }

    fn start_phase(&mut self, phase: Phase) {
        (self.phase, self.done, self.count) = (phase, 0, 0);
    }

    /// Sends the grasper's tip to the aim moved by `by` (m, cell).
    fn send_beside(&mut self, episode: &Episode, arm: &str, by: DVec3) -> Result<()> {
        let (Some(k), Some(aim)) = (episode.roles().0, &self.grasp) else { return Ok(()) };
        let tip = Pose { translation: aim.pose.translation + by, ..aim.pose };
        self.to[k] = episode.cell().solve(arm, &tip, &aim.setpoint)?.setpoint.with_jaw(0.0);
        Ok(())
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
                let (place, aside) = match &self.script {
                    Some(script) => (Place::At(script.at), script.approach_offset),
                    None => (Place::InRange([gates.grasp_from, gates.grasp_to], self.outward), 0.0),
                };
                let aim = aim::grasp(cell, arms[k], body, (place, Manner::Fitting), aside)?;
                self.grasp = Some(aim);
                let open = aim.setpoint;
                let behind = || Ok::<_, Error>(cell.workspace(arms[k])?.behind(&open, BACK));
                self.to[k] = if self.phase == Phase::Approach { behind()? } else { open };
                self.time(episode, k, if self.phase == Phase::Approach { FAST } else { SLOW })?
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

    /// Chooses the next phase by the present state of the episode.
    fn next(&mut self, episode: &Episode) {
        let (t, careful) = (seen(episode).task, self.style == Style::Careful);
        let tries = self.script.map_or(TRIES, |script| script.retries);
        let again = careful && self.tries < tries;
        let task = episode.scene().task.name;
        let drags = self.script.is_some_and(|script| script.regrasp.is_some()) && !self.dragged;
        let after = self.script.map(|script| script.after);
        let next = match self.phase {
            Phase::Approach => Phase::Enter,
            Phase::Enter => Phase::Close,
            Phase::Close if t.grasped == 0.0 && again => {
                self.tries += 1;
                self.grip.missed(self.has_pierced(episode));
                Phase::Approach
            }
            Phase::Close if drags => Phase::Drag,
            Phase::Close => Phase::Lift,
            Phase::Drag => Phase::Release,
            Phase::Release => Phase::Close,
            Phase::Lift if !careful && task != TaskName::GraspLift => Phase::Reach,
            Phase::Lift if careful && after.is_none() && self.goes_on(episode, 0.0) => Phase::Rise,
            Phase::Rise if self.goes_on(episode, self.risen_mm + 1e3 * RISES * RISE) => Phase::Rise,
            Phase::Lift | Phase::Rise => Phase::Hold,
            Phase::Hold if t.grasped == 0.0 && again => {
                self.tries += 1;
                Phase::Approach
            }
            Phase::Hold if after.is_none() && again && !is_lifted(episode) => {
                self.tries += 1;
                self.outward += OUTWARD;
                self.grip.slipped();
                Phase::Lower
            }
            Phase::Hold if after == Some(AfterHold::Finish) => Phase::Finished,
            Phase::Hold if after == Some(AfterHold::Lower) => Phase::Lower,
            Phase::Hold if after.is_none() && task == TaskName::GraspLift => Phase::Rest,
            Phase::Hold => {
                self.tries = 0;
                Phase::Reach
            }
            Phase::Lower => Phase::Open,
            Phase::Reach => Phase::Engage,
            Phase::Engage if t.cut_mouth == 0.0 && again => {
                self.tries += 1;
                Phase::Engage
            }
            Phase::Engage => Phase::Cut,
            Phase::Cut if after.is_some() => Phase::Carry,
            Phase::Cut if again => {
                self.tries += 1;
                Phase::Reach
            }
            Phase::Carry => Phase::Keep,
            Phase::Open if after.is_none() => Phase::Approach,
            Phase::Open | Phase::Keep | Phase::Finished => Phase::Finished,
            Phase::Cut => Phase::Rest,
            Phase::Target(n) if n < 2 => Phase::Target(n + 1),
            Phase::Target(_) | Phase::Rest => Phase::Rest,
        };
        self.start_phase(next);
    }

    /// Whether the phase is over before its time: the jaws hold tissue, or open blades are as deep
    /// in it as the jaws can close on.
    fn early(&self, episode: &Episode) -> bool {
        let holds = self.feels() && seen(episode).task.grasped > 0.0;
        self.done > 0 && (holds || self.spread(episode) >= MAX_SPREAD)
    }

    /// While open blades go into tissue: the force with which it presses them apart, over that of
    /// the jaws; else 0.
    fn spread(&self, episode: &Episode) -> f64 {
        if self.style != Style::Careful || !self.goes_in() {
            return 0.0;
        }
        let Some(k) = episode.roles().0 else { return 0.0 };
        let jaws = episode.scene().tools().get(k).map_or(f64::INFINITY, |tool| tool.instrument.jaw_force_n);
        episode.cell().observe()[k].jaw_force / jaws
    }

    /// Whether open blades are on their way to the grasp.
    fn goes_in(&self) -> bool {
        matches!(self.phase, Phase::Approach | Phase::Enter)
    }

    /// Makes the place where the grasper is that of the grasp.
    fn stay(&mut self, episode: &Episode) {
        let Some(k) = episode.roles().0 else { return };
        let tip = episode.cell().observe()[k].tip;
        if let (Some(aim), Some(last)) = (&mut self.grasp, self.last.get(k)) {
            (aim.pose.translation, aim.setpoint) = (tip.translation, *last);
        }
    }

    /// Whether the jaws are closing and respond to the tissue's force.
    fn feels(&self) -> bool {
        self.style == Style::Careful && self.phase == Phase::Close
    }

    /// Whether the lift continues: the tissue has risen by `least` (mm), and not yet enough.
    fn goes_on(&self, episode: &Episode, least: f64) -> bool {
        let (t, gate) = (seen(episode).task, episode.scene().task.gates.lift_mm);
        let wanted = t.lift_mm < gate + 1e3 * ENOUGH_ABOVE;
        t.grasped > 0.0 && wanted && t.lift_mm >= least && self.lift < 1e-3 * gate + MAX_ABOVE
    }

    /// Whether the grasper has pierced an organ.
    fn has_pierced(&self, episode: &Episode) -> bool {
        let arms = episode.cell().arms();
        let grasper = episode.roles().0.and_then(|k| arms.get(k));
        grasper.is_some_and(|(side, _)| episode.cell().pierces(side.name()).unwrap_or(false))
    }

    fn action(&mut self, episode: &Episode) -> Result<Action> {
        if self.count == 0 {
            self.enter(episode)?;
        }
        if let Some(k) = episode.roles().0.filter(|_| self.feels()) {
            let arm = &episode.cell().observe()[k];
            self.to[k] = self.to[k].with_jaw(self.grip.opening(arm.measured.jaw(), arm.jaw_force));
        }
        self.done += 1;
        let share = eased(self.done as f64 / self.count as f64);
        let targets: Vec<Setpoint> = self.from.iter().zip(&self.to).map(|(a, b)| a.towards(b, share)).collect();
        let spaces = episode.cell().arms().into_iter().map(|(side, _)| episode.cell().workspace(side.name()));
        let spaces: Vec<_> = spaces.collect::<std::result::Result<_, _>>()?;
        let kept: Vec<Setpoint> = targets.iter().zip(spaces).map(|(c, space)| space.clamp(c)).collect();
        let action = Action::targets(&kept);
        self.last = kept;
        Ok(action)
    }
}

/// The channels as they are now.
fn seen(episode: &Episode) -> Channels {
    episode.rows().last().copied().unwrap_or_default()
}

/// Whether held tissue is up as the task's stages of a lift want it, for however long.
fn is_lifted(episode: &Episode) -> bool {
    let (program, row) = (episode.program(), seen(episode));
    let context = Context { row: &row, rows: &[], constants: &program.constants };
    let mut stages = program.stages.iter().filter(|stage| LIFTED.contains(&stage.name.as_str()));
    stages.all(|stage| {
        let now: &Condition = if let Condition::Lasts { what, .. } = &stage.when { what } else { &stage.when };
        context.holds(now, &mut Memory::new(stage.timers, stage.marks))
    })
}

/// Whether what the arm at place `k` holds hangs on nothing that is pinned.
fn is_free(episode: &Episode, k: usize) -> bool {
    let bodies = episode.cell().world().model.bodies();
    episode.cell().carried(k).is_some_and(|held| !bodies[held.organ].pinned().contains(&true))
}

impl Policy for Scripted {
    fn name(&self) -> &str {
        self.name
    }

    fn begin(&mut self, episode: &Episode, _seed: u64) -> Result<()> {
        *self = Self { script: self.script, ..Self::new(self.style) };
        if let Some(script) = &self.script {
            script.check()?;
        }
        let greedy = self.style == Style::Greedy;
        self.start_phase(match episode.scene().task.name {
            TaskName::PortReach => Phase::Target(0),
            _ if greedy => Phase::Enter,
            _ => Phase::Approach,
        });
        Ok(())
    }

    fn finished(&self) -> bool {
        self.phase == Phase::Finished
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let mut chunk = Vec::with_capacity(CHUNK);
        if self.early(episode) {
            if self.goes_in() {
                self.stay(episode);
                self.phase = Phase::Enter;
            }
            self.next(episode);
        }
        while chunk.len() < CHUNK {
            if self.count > 0 && self.done >= self.count {
                // The next phase depends on the observation, so a chunk ends with its phase.
                if !chunk.is_empty() {
                    break;
                }
                self.next(episode);
                if self.style == Style::Greedy && self.phase == Phase::Reach {
                    self.phase = Phase::Engage;
                }
            }
            if self.phase == Phase::Finished {
                break;
            }
            chunk.push(self.action(episode)?);
            if self.feels() || self.spread(episode) > WATCHED_SPREAD {
                break;
            }
        }
        Ok(chunk)
    }
}
