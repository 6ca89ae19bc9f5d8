//! Random legal actions, for tests that nothing breaks.

use crate::{Action, ActionSpace, Cell, Policy, ROLL_SPEED, Result, TIP_SPEED};
use trocar_robot::instrument::Coordinates;

/// Half of the targets lie at this insertion [m] or deeper, where the tissue is.
const DEEP: f64 = 0.09;

/// An action is kept for up to so many periods.
const LONGEST: f64 = 20.0;

/// A policy that asks for anything an action may ask for: targets over all that the arms are let
/// reach, or steps of the tip of any size, each kept for 1 to 20 periods. The same seed does the
/// same.
#[derive(Clone, Debug)]
pub struct RandomActions {
    arms: Vec<String>,
    /// State of the generator (splitmix64).
    dice: u64,
    space: ActionSpace,
    action: Option<Action>,
    /// Periods that the action is kept for.
    left: u32,
}

impl RandomActions {
    /// Every fourth seed (3, 7, ...) moves the tips, the others ask for coordinates in the ports.
    /// `arms` are the names of the cell's arms, in their order.
    pub fn new(seed: u64, arms: &[&str]) -> Self {
        let space = if seed % 4 == 3 { ActionSpace::Tip } else { ActionSpace::Pivots };
        Self { arms: arms.iter().map(|arm| (*arm).to_owned()).collect(), dice: seed, space, action: None, left: 0 }
    }

    /// A number from 0 to 1.
    fn roll(&mut self) -> f64 {
        self.dice = self.dice.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.dice;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.roll()
    }

    /// Anywhere that an arm may go; half of the time deep.
    fn coordinates(&mut self, cell: &Cell, arm: &str) -> Result<Coordinates> {
        let limits = cell.limits(arm)?;
        loop {
            let pivots = [(); 2].map(|()| self.within(-limits.tilt, limits.tilt));
            let deep = self.roll() < 0.5;
            let low = if deep { DEEP.clamp(limits.insertion[0], limits.insertion[1]) } else { limits.insertion[0] };
            let insertion = self.within(low, limits.insertion[1]);
            let roll = self.within(limits.roll[0], limits.roll[1]);
            let c = Coordinates { pivots, insertion, roll, jaw: self.roll() };
            // Three of four are.
            if c.tilt() <= limits.tilt {
                return Ok(c);
            }
        }
    }

    /// Another action.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn draw(&mut self, cell: &Cell) -> Result<Action> {
        match self.space {
            ActionSpace::Pivots => {
                let arms = self.arms.clone();
                let targets: Vec<Coordinates> =
                    arms.iter().map(|arm| self.coordinates(cell, arm)).collect::<Result<_>>()?;
                Ok(Action::pivots(&targets))
            }
            ActionSpace::Tip => {
                let (tip, roll) = (TIP_SPEED * cell.period(), ROLL_SPEED * cell.period());
                let mut numbers = Vec::with_capacity(5 * self.arms.len());
                for _ in 0..self.arms.len() {
                    (0..3).for_each(|_| numbers.push(self.within(-tip, tip)));
                    numbers.push(self.within(-roll, roll));
                    numbers.push(self.roll());
                }
                Ok(Action { space: ActionSpace::Tip, numbers })
            }
        }
    }
}

impl Policy for RandomActions {
    fn act(&mut self, cell: &Cell) -> Result<Option<Action>> {
        if self.left == 0 || self.action.is_none() {
            self.action = Some(self.draw(cell)?);
            self.left = 1 + (LONGEST * self.roll()) as u32;
        }
        self.left -= 1;
        Ok(self.action.clone())
    }
}
