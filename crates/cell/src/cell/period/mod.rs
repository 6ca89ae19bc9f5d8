//! The stages of a control period, one module each.
//!
//! Tissue is stepped 60 times a second, arms 480 times. In a tissue frame the arms go first, under
//! the load that tissue had on them at the end of the last frame, extrapolated with the tip. Then
//! tissue is stepped with tools that go from where the tips were at the beginning of the frame to
//! where they are now.

mod command;
mod exchange_forces;
mod move_arms;
mod observe;
mod step_tissue;

use super::Cell;
use super::report::{CellReport, PeriodLog};
use crate::Result;
use std::time::Instant;

impl Cell {
    /// Does one control period towards what the arms were last asked for.
    ///
    /// # Errors
    /// An arm whose numbers are not finite any more.
    pub fn advance(&mut self) -> Result<CellReport> {
        let clock = Instant::now();
        let mut log = PeriodLog::default();
        self.command(&mut log)?;
        for _ in 0..self.frames {
            self.move_arms()?;
            let tissue = self.step_tissue(&mut log);
            self.exchange_forces(&mut log)?;
            self.enforce_tissue_limits(tissue.min_volume_ratio, &mut log);
        }
        self.periods += 1;
        let report = self.observe_period(log);
        self.timing.all += clock.elapsed();
        Ok(report)
    }
}
