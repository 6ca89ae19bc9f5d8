//! Rule: an organ that stays folded without an instrument at it is relaxed instantly.
//!
//! Tissue that snaps back may stay folded: elements that would have to invert to unfold lock each
//! other. An organ without an instrument at it that is overstretched or crushed, or that stays
//! strained for [`MAX_WAIT_FRAMES`], is relaxed by [`trocar_tissue::State::relax`], without regard
//! to time and forces.

use super::scope::Scope;
use super::strain::MAX_WAIT_FRAMES;
use crate::cell::report::CellEvent;

/// Relaxes `organ` if necessary; returns the event.
pub(super) fn apply(scope: &mut Scope<'_>, organ: usize) -> Option<CellEvent> {
    let (strain, wait) = (scope.strains[organ], &mut scope.waits[organ]);
    if strain.is_too_much() || strain.lasts() && *wait >= MAX_WAIT_FRAMES {
        *wait = 0;
        scope.world.state.relax(organ);
        scope.log.rules.relaxed += 1;
        let name = scope.world.model.bodies()[organ].name().to_owned();
        return Some(CellEvent::Relaxed { organ: name, stretch: strain.stretch, volume: strain.volume });
    }
    *wait = if strain.lasts() { *wait + 1 } else { 0 };
    None
}
