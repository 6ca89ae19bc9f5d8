//! Random legal actions, for tests that nothing breaks.

use super::{CHUNK, Policy};
use crate::{Episode, Result};
use trocar_cell::{Action, ActionSpace, ROLL_SPEED, Setpoint, TIP_SPEED, Workspace};
use trocar_scene::EpisodeRandom;

/// Half of the targets lie at this insertion (m) or deeper, where the tissue is.
const DEEP: f64 = 0.09;

/// An action is kept for up to this many periods.
const MAX_KEPT: f64 = 20.0;

/// A policy that asks for anything an action may ask for: targets in all of the workspaces, or
/// steps of the tips of any size, each kept for 1 to 20 periods. The same seed does the same.
#[derive(Clone, Debug)]
pub struct RandomActions {
    random: EpisodeRandom,
    count: u64,
    space: ActionSpace,
    action: Action,
    /// Periods that the action is kept for.
    left: u32,
}

impl Default for RandomActions {
    fn default() -> Self {
        let action = Action { space: ActionSpace::Pivots, numbers: Vec::new() };
        Self { random: EpisodeRandom::new(0, "random-actions"), count: 0, space: ActionSpace::Pivots, action, left: 0 }
    }
}

impl RandomActions {
    /// The next number in [0, 1).
    fn roll(&mut self) -> f64 {
        self.count += 1;
        self.random.unit(self.count)
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.roll()
    }

    /// Anywhere that an instrument may go; in a port half of the time deep.
    fn target(&mut self, workspace: &Workspace) -> Setpoint {
        loop {
            let mut bounds = workspace.bounds();
            if workspace.as_port().is_some() && self.roll() < 0.5 {
                bounds[2][0] = DEEP.clamp(bounds[2][0], bounds[2][1]);
            }
            let target = Setpoint(bounds.map(|[low, high]| self.within(low, high)));
            // About three quarters of all pairs of pivots are inside their cone.
            if workspace.clamp(&target).0[..2].iter().zip(&target.0).all(|(a, b)| (a - b).abs() < 1e-12) {
                return target;
            }
        }
    }

    /// Another action.
    ///
    /// # Errors
    /// A cell that has lost an arm.
    pub fn draw(&mut self, episode: &Episode) -> Result<Action> {
        let cell = episode.cell();
        let mut numbers = Vec::new();
        for (side, _) in cell.arms() {
            match self.space {
                ActionSpace::Pivots => numbers.extend(self.target(cell.workspace(side.name())?).0),
                ActionSpace::Tip => {
                    let (tip, roll) = (TIP_SPEED * cell.period(), ROLL_SPEED * cell.period());
                    (0..3).for_each(|_| numbers.push(self.within(-tip, tip)));
                    numbers.push(self.within(-roll, roll));
                    numbers.push(self.roll());
                }
            }
        }
        Ok(Action { space: self.space, numbers })
    }
}

impl Policy for RandomActions {
    fn name(&self) -> &str {
        "random-actions"
    }

    /// Every fourth seed (3, 7, ...) moves the tips, the others ask for absolute targets.
    fn begin(&mut self, _episode: &Episode, seed: u64) -> Result<()> {
        let space = if seed % 4 == 3 { ActionSpace::Tip } else { ActionSpace::Pivots };
        *self = Self { random: EpisodeRandom::new(seed, "random-actions"), space, ..Self::default() };
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let mut chunk = Vec::with_capacity(CHUNK);
        for _ in 0..CHUNK {
            if self.left == 0 {
                self.action = self.draw(episode)?;
                self.left = 1 + (MAX_KEPT * self.roll()) as u32;
            }
            self.left -= 1;
            chunk.push(self.action.clone());
        }
        Ok(chunk)
    }
}
