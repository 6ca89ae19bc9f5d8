//! The box of legal actions, for policies that come from outside and may step over its edges.

use crate::{Error, Result};
use trocar_cell::{Action, ActionSpace, Cell, ROLL_SPEED, TIP_SPEED};
use trocar_robot::instrument::{Coordinates, Limits};

/// Numbers an arm.
const NUMBERS: usize = 5;

/// What the numbers of a cell's actions are, and between which they may lie.
#[derive(Clone, Debug)]
pub struct Bounds {
    space: ActionSpace,
    limits: Vec<Limits>,
    /// Names of the numbers, such as `left_insertion`.
    pub names: Vec<String>,
    /// The least ...
    pub low: Vec<f64>,
    /// ... and the greatest.
    pub high: Vec<f64>,
}

impl Bounds {
    /// Those of `cell` in `space`.
    ///
    /// # Errors
    /// A cell that has lost an arm.
    pub fn new(cell: &Cell, space: ActionSpace) -> Result<Self> {
        let mut made = Self { space, limits: Vec::new(), names: Vec::new(), low: Vec::new(), high: Vec::new() };
        let (step, roll) = (TIP_SPEED * cell.period(), ROLL_SPEED * cell.period());
        for (side, _) in cell.arms() {
            let limits = cell.limits(side.name())?;
            let tilt = [-limits.tilt, limits.tilt];
            let bounds = match space {
                ActionSpace::Pivots => [tilt, tilt, limits.insertion, limits.roll, [0.0, 1.0]],
                ActionSpace::Tip => [[-step, step], [-step, step], [-step, step], [-roll, roll], [0.0, 1.0]],
            };
            for ([low, high], name) in bounds.into_iter().zip(space.names()) {
                made.low.push(low);
                made.high.push(high);
                made.names.push(format!("{}_{}", side.name(), name.replace(' ', "_")));
            }
            made.limits.push(limits);
        }
        Ok(made)
    }

    /// The action of these numbers. What lies outside is brought back to the edge, as a robot's own
    /// limits do; the box of two pivots has corners that no shaft reaches, and those are brought
    /// back too.
    ///
    /// # Errors
    /// Too few or too many numbers, or one that is not finite, by its name.
    pub fn action(&self, numbers: &[f64]) -> Result<Action> {
        if numbers.len() != self.low.len() {
            return Err(Error::Option(format!(
                "an action has {} numbers; {} are needed",
                numbers.len(),
                self.low.len()
            )));
        }
        if let Some(k) = numbers.iter().position(|n| !n.is_finite()) {
            return Err(Error::Option(format!(
                "action[{k}] ({}): is {}; it must be finite",
                self.names[k], numbers[k]
            )));
        }
        let within = numbers.iter().zip(&self.low).zip(&self.high).map(|((n, low), high)| n.max(*low).min(*high));
        let mut within: Vec<f64> = within.collect();
        if self.space == ActionSpace::Pivots {
            for (n, limits) in within.chunks_exact_mut(NUMBERS).zip(&self.limits) {
                let wanted = Coordinates { pivots: [n[0], n[1]], insertion: n[2], roll: n[3], jaw: n[4] };
                n.copy_from_slice(&limits.clamp(&wanted).0.to_action());
            }
        }
        Ok(Action { space: self.space, numbers: within })
    }
}
