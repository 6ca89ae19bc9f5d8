//! Stage 2: the arms get their commands when the control delay is over, and move for a tissue
//! frame, in physics steps, under the load of the tissue and among solids.

use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;
use crate::{FRAME, Result};
use std::time::Instant;
use trocar_core::{Pose, Wrench};
use trocar_robot::manipulator::Obstacle;

impl Cell {
    /// For tissue frame `frame` of the control period.
    pub(super) fn move_arms(&mut self, frame: u32, log: &mut PeriodLog) -> Result<()> {
        let clock = Instant::now();
        let dt = FRAME / f64::from(self.physics_steps);
        self.solids.holes.clone_from(&self.world.state.holes);
        self.solids.pinned.follow(&self.world);
        for step in 0..self.physics_steps {
            if frame * self.physics_steps + step == self.delay.step {
                self.command(log)?;
            }
            self.solids.step(&mut self.arms, dt)?;
        }
        self.arms.iter_mut().for_each(|arm| arm.state.solid.end_frame(self.physics_steps));
        self.timing.arms += clock.elapsed();
        Ok(())
    }
}

impl ArmUnit {
    /// A physics step of `dt` (s) under the load of tissue and `pushed`, another instrument's force
    /// (N) and torque about the tip (N m), among `obstacles`.
    pub fn step(&mut self, pushed: Wrench, obstacles: &mut [Obstacle], dt: f64) -> Result<()> {
        let Self { drive, state, .. } = self;
        let load = |tip: &Pose| {
            let tissue = state.exchange.load(tip.translation);
            // It is not added as a zero, because that would change the sign of a negative zero.
            if pushed == Wrench::default() { tissue } else { tissue + pushed }
        };
        let moved = drive.step(load, obstacles, dt)?;
        state.rcm_peak = state.rcm_peak.max(moved.rcm_deviation);
        state.held_back |= !moved.on_time;
        Ok(())
    }
}
