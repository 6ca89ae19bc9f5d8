//! Stage 1: each arm gets a setpoint for the period, within its speed limits, above the floor, and
//! no further against a force than the force guard lets it.

use crate::Result;
use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Wanted};
use crate::cell::report::PeriodLog;

impl Cell {
    pub(super) fn command(&mut self, log: &mut PeriodLog) -> Result<()> {
        for arm in &mut self.arms {
            arm.command()?;
            log.rules.guarded += usize::from(arm.state.guarded);
        }
        Ok(())
    }
}

impl ArmUnit {
    fn command(&mut self) -> Result<()> {
        let Self { model, drive, state } = self;
        let space = &model.workspace;
        (state.rcm_peak, state.guarded) = (0.0, false);
        let Wanted::Setpoint(wanted, _) = state.wanted else { return Ok(()) };
        let (paced, far) = space.paced(&state.commanded, &wanted, model.period);
        let (mut next, low) = space.above_floor(&paced);
        state.guard.begin_period(state.exchange.force(), drive.tip().translation);
        let from = space.tip(&state.commanded).translation;
        let mut tip = space.tip(&next);
        let way = tip.translation - from;
        let allowed = state.guard.allow(way, model.force_limit);
        state.guarded = allowed != way;
        if state.guarded {
            tip.translation = from + allowed;
            next = space.solve(&tip, &next)?.setpoint.with_roll(next.roll());
        }
        let sent = drive.command(&next)?;
        (state.commanded, state.held_back) = (sent.setpoint, far || low || state.guarded || !sent.whole);
        Ok(())
    }
}
