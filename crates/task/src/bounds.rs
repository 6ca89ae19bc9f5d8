//! The box of legal actions, for policies that come from outside and may step over its edges.

use crate::{Error, Result};
use trocar_cell::{Action, ActionSpace, Cell, ROLL_SPEED, Setpoint, TIP_SPEED, Workspace};

/// Numbers an arm.
const NUMBERS: usize = 5;

/// The names of the numbers of a cell's actions, and their ranges.
#[derive(Clone, Debug)]
pub struct Bounds {
    space: ActionSpace,
    workspaces: Vec<Workspace>,
    /// Names of the numbers, such as `left_insertion`.
    pub names: Vec<String>,
    /// Least values.
    pub low: Vec<f64>,
    /// Greatest values.
    pub high: Vec<f64>,
}

impl Bounds {
    /// Those of `cell` in `space`.
    ///
    /// # Errors
    /// A cell that has lost an arm.
    pub fn new(cell: &Cell, space: ActionSpace) -> Result<Self> {
        let mut made = Self { space, workspaces: Vec::new(), names: Vec::new(), low: Vec::new(), high: Vec::new() };
        let (step, roll) = (TIP_SPEED * cell.period(), ROLL_SPEED * cell.period());
        for (side, _) in cell.arms() {
            let workspace = cell.workspace(side.name())?;
            let bounds = match space {
                ActionSpace::Pivots => workspace.bounds(),
                ActionSpace::Tip => [[-step, step], [-step, step], [-step, step], [-roll, roll], [0.0, 1.0]],
            };
            for ([low, high], name) in bounds.into_iter().zip(space.names(workspace)) {
                made.low.push(low);
                made.high.push(high);
                made.names.push(format!("{}_{}", side.name(), name.replace(' ', "_")));
            }
            made.workspaces.push(workspace.clone());
        }
        Ok(made)
    }

    /// The action of these numbers. Numbers outside the limits are clamped to them, as a robot's
    /// own limits do. The box of two pivots has corners that no shaft reaches, and those are
    /// clamped too.
    ///
    /// # Errors
    /// Too few or too many numbers, or one that is not finite, by its name.
    pub fn action(&self, numbers: &[f64]) -> Result<Action> {
        if numbers.len() != self.low.len() {
            let (given, needed) = (numbers.len(), self.low.len());
            return Err(Error::Option(format!("an action has {given} numbers; {needed} are needed")));
        }
        if let Some(k) = numbers.iter().position(|n| !n.is_finite()) {
            let (name, value) = (&self.names[k], numbers[k]);
            return Err(Error::Option(format!("action[{k}] ({name}): is {value}; it must be finite")));
        }
        let within = numbers.iter().zip(&self.low).zip(&self.high).map(|((n, low), high)| n.max(*low).min(*high));
        let mut within: Vec<f64> = within.collect();
        if self.space == ActionSpace::Pivots {
            for (n, workspace) in within.chunks_exact_mut(NUMBERS).zip(&self.workspaces) {
                let wanted = Setpoint([n[0], n[1], n[2], n[3], n[4]]);
                n.copy_from_slice(&workspace.clamp(&wanted).0);
            }
        }
        Ok(Action { space: self.space, numbers: within })
    }
}
