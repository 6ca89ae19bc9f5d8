//! Actions out of arrays: their limits as a box, and what lies outside of them brought back.

use crate::error::wrong;
use pyo3::PyResult;
use trocar_cell::{Action, ActionSpace, Cell, ROLL_SPEED, TIP_SPEED};
use trocar_robot::instrument::{Coordinates, Limits};

/// Numbers an arm.
const NUMBERS: usize = 5;

/// What an episode's actions are, and their limits.
#[derive(Clone)]
pub struct Actions {
    space: ActionSpace,
    limits: Vec<Limits>,
    /// Names of the numbers, least and greatest.
    pub names: Vec<String>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

impl Actions {
    /// Those of `cell` in the space `pivots` or `tip`.
    pub fn new(cell: &Cell, space: &str) -> PyResult<Self> {
        let space = match space {
            "pivots" => ActionSpace::Pivots,
            "tip" => ActionSpace::Tip,
            other => return Err(wrong(format!("actions: '{other}' is unknown; pivots (absolute targets) or tip (steps of the tip)"))),
        };
        let mut made = Self { space, limits: Vec::new(), names: Vec::new(), low: Vec::new(), high: Vec::new() };
        for (side, _) in cell.arms() {
            let limits = cell.limits(side.name()).map_err(wrong)?;
            let (step, roll) = (TIP_SPEED * cell.period(), ROLL_SPEED * cell.period());
            let bounds = match space {
                ActionSpace::Pivots => {
                    [[-limits.tilt, limits.tilt], [-limits.tilt, limits.tilt], limits.insertion, limits.roll, [0.0, 1.0]]
                }
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

    /// Numbers of an action.
    pub fn len(&self) -> usize {
        self.low.len()
    }

    /// The action of these numbers. What lies outside the limits is brought back to them: the box of two pivots holds corners that no shaft reaches. Numbers that are not finite are an error.
    pub fn action(&self, numbers: &[f64]) -> PyResult<Action> {
        if let Some(k) = numbers.iter().position(|n| !n.is_finite()) {
            return Err(wrong(format!("action[{k}] ({}): is {}; it must be finite", self.names[k], numbers[k])));
        }
        let mut within: Vec<f64> = numbers.iter().zip(&self.low).zip(&self.high).map(|((n, l), h)| n.clamp(*l, *h)).collect();
        if self.space == ActionSpace::Pivots {
            for (n, limits) in within.chunks_exact_mut(NUMBERS).zip(&self.limits) {
                let wanted = Coordinates { pivots: [n[0], n[1]], insertion: n[2], roll: n[3], jaw: n[4] };
                n.copy_from_slice(&limits.clamp(&wanted).0.to_action());
            }
        }
        Ok(Action { space: self.space, numbers: within })
    }
}
