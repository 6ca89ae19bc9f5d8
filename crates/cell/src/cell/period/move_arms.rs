//! Stage 2: the arms get their commands when the control delay is over, and move for a tissue frame,
//! in physics steps, under the load of the tissue.

use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;
use crate::{FRAME, Result};
use std::time::Instant;

impl Cell {
    /// For tissue frame `frame` of the control period.
    pub(super) fn move_arms(&mut self, frame: u32, log: &mut PeriodLog) -> Result<()> {
        let clock = Instant::now();
        let dt = FRAME / f64::from(self.physics_steps);
        for step in 0..self.physics_steps {
            if frame * self.physics_steps + step == self.delay.step {
                self.command(log)?;
            }
            for arm in &mut self.arms {
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
