//! Stage 1: the action is checked whole. After the control delay each arm gets a setpoint for the
//! length of a period: within its speed limits, above the floor, and no further against a force
//! than the force guard allows.

use crate::cell::Cell;
use crate::cell::action::Action;
use crate::cell::arm::{ArmUnit, Wanted};
use crate::cell::report::PeriodLog;
use crate::cell::rules::{place, tip_and_roll};
use crate::cell::setpoint::NUMBERS;
use crate::{Error, Result};

impl Cell {
    /// Accepts an action. An action with an error changes nothing.
    pub(super) fn take(&mut self, action: Option<&Action>) -> Result<()> {
        if let Some(action) = action {
            self.check(action)?;
        }
        self.waiting.0.push_back(action.cloned());
        for arm in &mut self.arms {
            arm.state.rcm_peak = 0.0;
            arm.state.solid.begin_period();
        }
        Ok(())
    }

    /// Commands the arms by the action whose delay is over.
    pub(super) fn command(&mut self, log: &mut PeriodLog) -> Result<()> {
        if let Some(action) = self.waiting.arrived(self.delay.periods) {
            self.request(&action)?;
        }
        for arm in &mut self.arms {
            arm.command()?;
            log.rules.guarded += usize::from(arm.state.guarded);
        }
        Ok(())
    }

    fn check(&self, action: &Action) -> Result<()> {
        let needed = NUMBERS * self.arms.len();
        if action.numbers.len() != needed {
            return Err(Error::Action {
                index: action.numbers.len().min(needed),
                name: "length".to_owned(),
                reason: format!("is {}; {needed} numbers, {NUMBERS} an arm", action.numbers.len()),
            });
        }
        self.arms.iter().enumerate().try_for_each(|(k, arm)| action.check(&arm.model, NUMBERS * k))
    }

    /// Takes over the requests of an action.
    fn request(&mut self, action: &Action) -> Result<()> {
        let wanted = self.arms.iter().enumerate().map(|(k, arm)| action.wanted(&arm.model, &arm.state, NUMBERS * k));
        let wanted: Vec<Wanted> = wanted.collect::<Result<_>>()?;
        for (arm, wanted) in self.arms.iter_mut().zip(wanted) {
            arm.state.wanted = wanted;
        }
        Ok(())
    }
}

impl ArmUnit {
    fn command(&mut self) -> Result<()> {
        let Self { model, drive, state } = self;
        let space = &model.workspace;
        state.guarded = false;
        let Wanted::Setpoint(wanted, _) = state.wanted else { return Ok(()) };
        let (paced, far) = space.paced(&state.commanded, &wanted, model.period);
        let (mut next, low) = space.above_floor(&paced);
        let reference = drive.reference();
        let from = place(space.tip(&reference).translation, reference.roll());
        let mut tip = space.tip(&next);
        let way = place(tip.translation, next.roll()) - from;
        let allowed = state.guard.allow(way, model.force_limit, model.period);
        state.guarded = allowed != way;
        if state.guarded {
            let (translation, roll) = tip_and_roll(from + allowed);
            tip.translation = translation;
            next = space.solve(&tip, &next)?.setpoint.with_roll(roll);
        }
        let sent = drive.command(&next)?;
        (state.commanded, state.held_back) = (sent.setpoint, far || low || state.guarded || !sent.whole);
        Ok(())
    }
}
