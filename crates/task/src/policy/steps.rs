//! The baseline of a custom task: the steps of its `[[task.script]]`, one after another.
//!
//! Like the scripted controller it looks at where the tissue is, which no policy that is scored
//! may, closes the jaws as far as the tissue gives ([`Grip`]), and all it does goes through
//! actions. An arm that loses what its last step `grasp` took, goes back to that step.

use super::aim::{self, Manner, Place, eased};
use super::grip::Grip;
use super::scripted::{Scripted, Style};
use super::{CHUNK, Policy};
use crate::bodies::bodies_of;
use crate::judge::{Context, Memory};
use crate::{Episode, Error, Result};
use glam::DVec3;
use trocar_cell::{Action, Setpoint};
use trocar_core::Pose;
use trocar_scene::{ScriptAction, ScriptProgram};

/// Way along the shaft from which open jaws come and to which they draw back (m).
const BACK: f64 = 0.025;
/// Speed of the tips on the way, at tissue, and with tissue in the jaws (m/s).
const FAST: f64 = 0.04;
const SLOW: f64 = 0.025;
const HELD: f64 = 0.015;
/// Longest time that jaws get to take hold, and the time that they open in (s).
const CLOSE_S: f64 = 1.5;
const OPEN_S: f64 = 0.5;
/// Times that it tries again to grasp.
const TRIES: usize = 3;

/// A part of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Approach,
    Enter,
    Close,
    Move,
    Open,
    Withdraw,
    Wait,
}

/// Follows the script of the episode's task.
#[derive(Clone, Debug, Default)]
struct Steps {
    step: usize,
    phase: Option<Phase>,
    /// Periods of the phase that are over, of as many.
    done: usize,
    count: usize,
    from: Vec<Setpoint>,
    to: Vec<Setpoint>,
    last: Vec<Setpoint>,
    until: Memory,
    /// How each arm closes and comes, whether on a fold, and how often it has tried in its last
    /// step `grasp`.
    grips: Vec<Grip>,
    manners: Vec<Manner>,
    folds: Vec<bool>,
    tries: Vec<usize>,
    /// The step in which each arm grasped the tissue that it holds.
    held: Vec<Option<usize>>,
}

impl Steps {
    fn begin(episode: &Episode) -> Result<Self> {
        let mut made = Self::default();
        let arms = episode.cell().arms();
        made.last = arms.iter().map(|(side, _)| Ok(episode.cell().setpoint(side.name())?)).collect::<Result<_>>()?;
        (made.grips, made.manners) = (vec![Grip::default(); arms.len()], vec![Manner::Fitting; arms.len()]);
        (made.tries, made.held, made.folds) = (vec![0; arms.len()], vec![None; arms.len()], vec![false; arms.len()]);
        made.enter_step(episode)?;
        Ok(made)
    }

    fn script<'e>(&self, episode: &'e Episode) -> Option<&'e ScriptProgram> {
        episode.program().script.get(self.step)
    }

    /// The place of the step's arm.
    fn arm(episode: &Episode, step: &ScriptProgram) -> Result<usize> {
        let place = episode.cell().arms().iter().position(|(side, _)| *side == step.arm);
        place.ok_or_else(|| Error::Option(format!("the scene has no {} arm", step.arm.name())))
    }

    fn enter_step(&mut self, episode: &Episode) -> Result<()> {
        let Some(step) = self.script(episode) else {
            self.phase = None;
            return Ok(());
        };
        self.until = Memory::new(step.timers, step.marks);
        let phase = match step.action {
            ScriptAction::Grasp(_) => {
                let k = Self::arm(episode, step)?;
                if self.held[k] != Some(self.step) {
                    (self.grips[k], self.manners[k], self.tries[k]) = (Grip::default(), Manner::Fitting, 0);
                }
                Phase::Approach
            }
            ScriptAction::Move(_) => Phase::Move,
            ScriptAction::Release => Phase::Open,
            ScriptAction::Wait => Phase::Wait,
        };
        self.enter(episode, phase)
    }

    fn enter(&mut self, episode: &Episode, phase: Phase) -> Result<()> {
        let Some(step) = self.script(episode) else { return Ok(()) };
        let (cell, k) = (episode.cell(), Self::arm(episode, step)?);
        let name = step.arm.name();
        (self.phase, self.done) = (Some(phase), 0);
        (self.from, self.to) = (self.last.clone(), self.last.clone());
        let way = |a: &Setpoint, b: &Setpoint, speed: f64| -> Result<f64> {
            let workspace = cell.workspace(name)?;
            let way = workspace.tip(a).translation.distance(workspace.tip(b).translation);
            Ok((1.5 * way / speed).max((a.roll() - b.roll()).abs()).max(0.3))
        };
        let seconds = match (phase, &step.action) {
            (Phase::Approach | Phase::Enter, ScriptAction::Grasp(part)) => {
                let body = bodies_of(cell, &part.organ).first().copied();
                let body = body.ok_or_else(|| Error::Option(format!("the scene has no organ '{}'", part.organ)))?;
                let place = Place::InRange(part.range, 0.0);
                let aim = aim::grasp(cell, name, body, (place, self.manners[k]), 0.0)?;
                let open = aim.setpoint;
                self.folds[k] = aim.folds;
                let near = phase == Phase::Enter;
                self.to[k] = if near { open } else { cell.workspace(name)?.behind(&open, BACK) };
                way(&self.from[k], &self.to[k], if near { SLOW } else { FAST })?
            }
            (Phase::Close, _) => {
                self.to[k] = self.to[k].with_jaw(0.0);
                self.from[k] = self.from[k].with_jaw(0.0);
                self.grips[k].begin(self.folds[k]);
                CLOSE_S
            }
            (Phase::Move, ScriptAction::Move(by)) => {
                let tip = cell.workspace(name)?.tip(&self.from[k]);
                let tip = Pose { translation: tip.translation + 1e-3 * DVec3::from_array(*by), ..tip };
                let jaw = self.from[k].jaw();
                self.to[k] = cell.solve(name, &tip, &self.from[k])?.setpoint.with_jaw(jaw);
                way(&self.from[k], &self.to[k], HELD)?
            }
            (Phase::Open, _) => {
                self.to[k] = self.to[k].with_jaw(1.0);
                OPEN_S
            }
            (Phase::Withdraw, _) => {
                self.to[k] = cell.workspace(name)?.behind(&self.from[k], BACK);
                way(&self.from[k], &self.to[k], SLOW)?
            }
            _ => 0.3,
        };
        let seconds = match phase {
            Phase::Move | Phase::Wait => step.seconds.unwrap_or(seconds),
            _ => seconds,
        };
        self.count = ((seconds / cell.period()).round() as usize).max(1);
        Ok(())
    }

    /// Goes on to what comes after the phase.
    fn next(&mut self, episode: &Episode) -> Result<()> {
        let Some(step) = self.script(episode) else { return Ok(()) };
        let k = Self::arm(episode, step)?;
        match self.phase {
            Some(Phase::Approach) => self.enter(episode, Phase::Enter),
            Some(Phase::Enter) => self.enter(episode, Phase::Close),
            Some(Phase::Close) if !holds(episode, step)? && self.tries[k] < TRIES => {
                self.tries[k] += 1;
                let pierced = episode.cell().pierces(step.arm.name())?;
                self.grips[k].missed(pierced);
                if pierced {
                    // There is no room for the blades beside the tissue.
                    self.manners[k] = Manner::Pinching;
                }
                self.enter(episode, Phase::Approach)
            }
            Some(Phase::Open) => self.enter(episode, Phase::Withdraw),
            phase => {
                match phase {
                    Some(Phase::Close) => self.held[k] = Some(self.step),
                    Some(Phase::Withdraw) => self.held[k] = None,
                    _ => {}
                }
                self.step += 1;
                self.skip_held(episode)?;
                self.enter_step(episode)
            }
        }
    }

    /// Skips grasps of tissue that is held already. They occur after an arm that lost its tissue
    /// has returned to its own grasp.
    fn skip_held(&mut self, episode: &Episode) -> Result<()> {
        while let Some(step) = self.script(episode) {
            let k = Self::arm(episode, step)?;
            if self.held[k] != Some(self.step) || !holds(episode, step)? {
                break;
            }
            self.step += 1;
        }
        Ok(())
    }

    /// The first arm that has lost its tissue and may try again, with the step that grasped it.
    fn lost(&self, episode: &Episode) -> Result<Option<(usize, usize)>> {
        for (k, held) in self.held.iter().enumerate() {
            let Some(at) = *held else { continue };
            let Some(step) = episode.program().script.get(at) else { continue };
            if self.tries[k] < TRIES && !holds(episode, step)? {
                return Ok(Some((k, at)));
            }
        }
        Ok(None)
    }

    /// The phase is over, by its time or by what is seen.
    fn over(&mut self, episode: &Episode) -> Result<bool> {
        let Some(step) = self.script(episode) else { return Ok(false) };
        if self.phase == Some(Phase::Close) && self.done > 0 && holds(episode, step)? {
            return Ok(true);
        }
        if let (Some(until), Some(row)) = (&step.until, episode.rows().last())
            && matches!(self.phase, Some(Phase::Move | Phase::Wait))
        {
            let context = Context { row, rows: &[], constants: &episode.program().constants };
            if context.holds(until, &mut self.until) {
                return Ok(true);
            }
        }
        Ok(self.done >= self.count)
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        if matches!(self.phase, Some(Phase::Move | Phase::Wait) | None)
            && let Some((k, at)) = self.lost(episode)?
        {
            self.tries[k] += 1;
            self.grips[k].slipped();
            self.step = at;
            self.enter_step(episode)?;
        }
        while self.phase.is_some() && self.over(episode)? {
            self.next(episode)?;
        }
        let step = self.script(episode);
        // The end of a step, and the force on closing jaws, are checked in every period. A motion
        // continues in chunks.
        let closing = self.phase == Some(Phase::Close);
        let looks = closing || step.is_some_and(|s| s.until.is_some());
        if let (Some(step), true) = (step, closing) {
            let k = Self::arm(episode, step)?;
            let arm = &episode.cell().observe()[k];
            self.to[k] = self.to[k].with_jaw(self.grips[k].opening(arm.measured.jaw(), arm.jaw_force));
        }
        let most = if looks || self.phase.is_none() { 1 } else { CHUNK };
        let mut chunk = Vec::with_capacity(most);
        while chunk.len() < most {
            let targets: Vec<Setpoint> = match self.phase {
                None => self.last.clone(),
                Some(_) => {
                    self.done += 1;
                    let share = eased(self.done as f64 / self.count as f64);
                    self.from.iter().zip(&self.to).map(|(a, b)| a.towards(b, share)).collect()
                }
            };
            let mut kept = Vec::with_capacity(targets.len());
            for ((side, _), target) in episode.cell().arms().into_iter().zip(&targets) {
                kept.push(episode.cell().workspace(side.name())?.clamp(target));
            }
            chunk.push(Action::targets(&kept));
            self.last = kept;
            if self.done >= self.count {
                break;
            }
        }
        Ok(chunk)
    }
}

/// Whether the step's arm holds the tissue that it is to grasp.
fn holds(episode: &Episode, step: &ScriptProgram) -> Result<bool> {
    let k = Steps::arm(episode, step)?;
    let ScriptAction::Grasp(part) = &step.action else { return Ok(false) };
    let bodies = bodies_of(episode.cell(), &part.organ);
    Ok(episode.cell().carried(k).is_some_and(|held| bodies.contains(&held.organ)))
}

/// The scripted baseline of any task: the steps of its script if it has one, else [`Scripted`].
#[derive(Clone, Debug)]
pub struct Baseline {
    scripted: Scripted,
    steps: Option<Steps>,
}

impl Default for Baseline {
    fn default() -> Self {
        Self { scripted: Scripted::new(Style::Careful), steps: None }
    }
}

impl Policy for Baseline {
    fn name(&self) -> &str {
        "scripted"
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()> {
        if episode.program().script.is_empty() {
            self.steps = None;
            return self.scripted.begin(episode, seed);
        }
        self.steps = Some(Steps::begin(episode)?);
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        match &mut self.steps {
            Some(steps) => steps.act(episode),
            None => self.scripted.act(episode),
        }
    }

    fn finished(&self) -> bool {
        self.steps.is_none() && self.scripted.finished()
    }
}
