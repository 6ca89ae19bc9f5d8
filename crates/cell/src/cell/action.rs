//! Actions: the commands to the arms for one control period.

use super::arm::{ArmModel, ArmState, Wanted};
use super::setpoint::{NUMBERS, Setpoint, in_range};
use super::speeds::{ROLL_SPEED, TIP_SPEED};
use super::workspace::Workspace;
use crate::{Error, Result};
use glam::DVec3;

/// The meaning of an action's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActionSpace {
    /// Absolute targets. Per arm in a port: two pivots (rad), insertion (m), roll (rad), jaw
    /// opening 0 to 1. Per arm without a port: place of the jaw's pivot in the cell (m), roll, jaw.
    Pivots,
    /// Per arm: motion of the tip along the cell's x, y and z (m), change of the roll (rad), both
    /// from what was commanded last; jaw opening 0 to 1.
    Tip,
}

impl ActionSpace {
    /// The names of the numbers of an arm in `workspace`.
    pub fn names(self, workspace: &Workspace) -> [&'static str; NUMBERS] {
        match self {
            Self::Pivots => workspace.names(),
            Self::Tip => ["tip x", "tip y", "tip z", "roll change", "jaw"],
        }
    }
}

/// The commands to the arms for one control period; the left arm's numbers first.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Their meaning.
    pub space: ActionSpace,
    /// Five for each arm.
    pub numbers: Vec<f64>,
}

impl Action {
    /// Absolute targets, one for each arm.
    pub fn targets(targets: &[Setpoint]) -> Self {
        Self { space: ActionSpace::Pivots, numbers: targets.iter().flat_map(|t| t.0).collect() }
    }

    /// Checks the five numbers from `first` on, for any state of the arm.
    pub(super) fn check(&self, model: &ArmModel, first: usize) -> Result<()> {
        self.mistake(model, &self.numbers[first..first + NUMBERS]).map_err(|(k, reason)| {
            let number = self.space.names(&model.workspace)[k];
            Error::Action { index: first + k, name: format!("{} {number}", model.side.name()), reason }
        })
    }

    /// The command in the five checked numbers from `first` on.
    pub(super) fn wanted(&self, model: &ArmModel, state: &ArmState, first: usize) -> Result<Wanted> {
        let n = &self.numbers[first..first + NUMBERS];
        let space = &model.workspace;
        match self.space {
            ActionSpace::Pivots => {
                let wanted = Setpoint([n[0], n[1], n[2], n[3], n[4]]);
                Ok(Wanted::Setpoint(space.clamp(&wanted), DVec3::ZERO))
            }
            ActionSpace::Tip => {
                let from = state.commanded.with_roll(state.commanded.roll() + n[3]).with_jaw(n[4]);
                let mut tip = space.tip(&from);
                tip.translation += DVec3::new(n[0], n[1], n[2]);
                let reached = space.solve(&tip, &from)?;
                // The direction follows from the position; the roll is the commanded one.
                let wanted = reached.setpoint.with_roll(from.roll());
                Ok(Wanted::Setpoint(space.clamp(&wanted), reached.rejected_rotation))
            }
        }
    }

    /// Finds a number that is wrong in any state of the arm: its index, and what would be right.
    fn mistake(&self, model: &ArmModel, n: &[f64]) -> std::result::Result<(), (usize, String)> {
        if let Some(k) = n.iter().position(|a| !a.is_finite()) {
            return Err((k, format!("is {}; it must be finite", n[k])));
        }
        match self.space {
            ActionSpace::Pivots => model.workspace.check(n)?,
            ActionSpace::Tip => {
                let (most, turn) = (TIP_SPEED * model.period, ROLL_SPEED * model.period);
                (0..3).try_for_each(|k| in_range(k, n[k], [-most, most], " m a step"))?;
                in_range(3, n[3], [-turn, turn], " rad a step")?;
            }
        }
        in_range(4, n[4], [0.0, 1.0], "")
    }
}
