//! Stage 2: the arms move for a tissue frame, in physics steps, under the load of the tissue.

use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::{FRAME, Result};
use std::time::Instant;

impl Cell {
    pub(super) fn move_arms(&mut self) -> Result<()> {
        let clock = Instant::now();
        let dt = FRAME / f64::from(self.physics_steps);
        for arm in &mut self.arms {
            for _ in 0..self.physics_steps {
                arm.step(dt)?;
            }
        }
        self.timing.arms += clock.elapsed();
        Ok(())
    }
}

impl ArmUnit {
    fn step(&mut self, dt: f64) -> Result<()> {
        let Self { drive, state, .. } = self;
        let moved = drive.step(|tip| state.exchange.load(tip.translation), dt)?;
        state.rcm_peak = state.rcm_peak.max(moved.rcm_deviation);
        state.held_back |= !moved.on_time;
        Ok(())
    }
}
