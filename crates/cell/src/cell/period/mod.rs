//! The stages of a control period, one module each.
//!
//! An action is checked at the start of the period and reaches the arms after the control delay,
//! which may end within a later period.
//!
//! Tissue is stepped 60 times a second, arms 480 times. In a tissue frame the arms move first,
//! under the tissue's load at the end of the last frame, extrapolated with the tip. Then tissue is
//! stepped with tools that move from the tips' places at the beginning of the frame to their places
//! now.

mod command;
mod cutting;
mod exchange_forces;
mod move_arms;
mod observe;
mod puncture;
mod stop_in_time;
mod tissue_frame;

use super::Cell;
use super::action::Action;
use super::report::{CellReport, PeriodLog};
use crate::{Result, World};
use std::time::{Duration, Instant};

impl Cell {
    /// Steps the cell by one control period. Without an action (`None`) the arms continue towards
    /// their last request.
    ///
    /// # Errors
    /// An action with an error is refused with the number's index and name, and nothing changes. If
    /// an arm's numbers are no longer finite, restore a state.
    pub fn step<'a>(&mut self, action: impl Into<Option<&'a Action>>) -> Result<CellReport> {
        self.step_watched(action, &mut |_| {})
    }

    /// The same with a `watch` that sees the cell after each tissue frame. The `watch` must not
    /// change the following steps.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_watched<'a>(
        &mut self,
        action: impl Into<Option<&'a Action>>,
        watch: &mut dyn FnMut(&mut Self),
    ) -> Result<CellReport> {
        let (mut clock, mut wall) = (Instant::now(), Duration::ZERO);
        let mut log = PeriodLog::default();
        self.take(action.into())?;
        for frame in 0..self.frames {
            self.move_arms(frame, &mut log)?;
            let start = self.begin_tissue_frame();
            let World { model, state, stepper, .. } = &mut self.world;
            let tissue = stepper.step_with_loads(model, state, &self.motions, &[]);
            self.end_tissue_frame(start, &tissue, &mut log);
            self.exchange_forces(&mut log)?;
            self.puncture(&mut log);
            let at_arms = self.watch_tissue(tissue.min_volume_ratio, &mut log);
            self.stop_in_time(&at_arms);
            // The time of whoever watches is not the cell's.
            wall += clock.elapsed();
            watch(self);
            clock = Instant::now();
        }
        self.periods += 1;
        let report = self.observe_period(log);
        self.timing.all += wall + clock.elapsed();
        Ok(report)
    }
}
