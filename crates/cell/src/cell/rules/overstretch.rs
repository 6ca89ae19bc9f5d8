//! Rule: an instrument releases tissue that it has overstretched or crushed.
//!
//! Real tissue tears at a stretch of about two; the model does not. So if an edge of an organ is
//! longer than [`MAX_STRETCH`] times its rest length, or an element has less than
//! [`MIN_VOLUME_SHARE`] of its rest volume, contact of the nearest instrument is disabled until the
//! tissue has recovered. Latched jaws keep their grasp at first and only stop pressing; they
//! release it beyond [`MAX_LATCHED_STRETCH`]. No reported figure depends on the motion after that.
//!
//! [`MAX_STRETCH`]: super::strain::MAX_STRETCH
//! [`MIN_VOLUME_SHARE`]: super::strain::MIN_VOLUME_SHARE
//! [`MAX_LATCHED_STRETCH`]: super::strain::MAX_LATCHED_STRETCH

use super::scope::Scope;
use super::strain::{MAX_LATCHED_STRETCH, MAX_WAIT_FRAMES};
use crate::World;
use crate::cell::arm::ArmUnit;
use glam::DVec3;

/// Largest distance of an instrument from the most strained tissue at which it is the cause (m).
const NEAR: f64 = 0.03;

/// The arm whose instrument touches the strained part of `organ`: one that only presses before one
/// that holds, then the nearest.
pub(super) fn instrument_at(scope: &Scope<'_>, organ: usize) -> Option<usize> {
    let at = scope.strains[organ].at;
    let near = scope.arms.iter().enumerate().filter(|(_, s)| is_at(scope.world, s, at, organ));
    let ranked = near.map(|(k, s)| (k, (s.holds(organ), s.distance(at))));
    ranked.min_by(|(_, a), (_, b)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(k, _)| k)
}

/// Whether the instrument of `arm` may be the cause of a strain of `organ` at `place` (m).
pub(super) fn is_at(world: &World, arm: &ArmUnit, place: DVec3, organ: usize) -> bool {
    let meets = arm.meets_tissue() || world.is_punctured(organ, arm.model.tools.gripper);
    !arm.state.contact_disabled && meets && (arm.distance(place) < NEAR || arm.holds(organ))
}

/// Disables contact of arm `k` if it strains `organ` too much. Tissue that was just released or
/// punctured has time to recover.
pub(super) fn apply(scope: &mut Scope<'_>, organ: usize, k: usize) {
    let strain = scope.strains[organ];
    let left_behind = scope.arms.iter().any(|s| {
        let punctured = scope.world.is_punctured(organ, s.model.tools.gripper);
        (s.state.contact_disabled || s.state.blades_disabled || punctured)
            && (s.distance(strain.at) < NEAR || s.holds(organ))
    });
    let patient = left_behind && scope.waits[organ] < MAX_WAIT_FRAMES && strain.stretch < MAX_LATCHED_STRETCH;
    if patient && strain.is_too_much() {
        scope.waits[organ] += 1;
        return;
    }
    scope.waits[organ] = 0;
    let arm = &scope.arms[k];
    if strain.is_beyond(arm.state.blades_disabled && arm.holds(organ)) {
        scope.log.rules.overstretched += 1;
        scope.disable_contact(k, organ);
    }
}
