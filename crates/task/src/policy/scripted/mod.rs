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

mod targets;
mod transitions;

use super::aim::{Aim, eased};
use super::grip::Grip;
use super::phase::Phase;
use super::script::Script;
use super::{CHUNK, Policy};
use crate::{Channels, Episode, Error, Result};
use transitions::WATCHED_SPREAD;
use trocar_cell::{Action, Setpoint};
use trocar_scene::TaskName;

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
    /// Times that the jaws backed off from this grasp.
    backs: usize,
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
            backs: 0,
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

    /// The body to be grasped or cut: of a cut organ the piece that kept its name.
    fn body(&self, episode: &Episode) -> Result<usize> {
        let bodies = episode.bodies();
        bodies.first().copied().ok_or_else(|| Error::Option("the scene has no organ to grasp".to_owned()))
    }

    fn start_phase(&mut self, phase: Phase) {
        (self.phase, self.done, self.count) = (phase, 0, 0);
    }

    /// Whether the jaws are closing and respond to the tissue's force.
    fn feels(&self) -> bool {
        self.style == Style::Careful && self.phase == Phase::Close
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
