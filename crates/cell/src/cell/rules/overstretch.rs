//! Warns of tissue that an instrument strains beyond its limits.
//!
//! Real tissue tears at a stretch of about two; the model does not. Where an edge of an organ is
//! longer than [`MAX_STRETCH`] times its rest length, or an element has less than
//! [`MIN_VOLUME_SHARE`] of its rest volume, with an instrument near, it is counted once until the
//! organ has recovered. The motion that follows is the model's; real tissue would not survive it.
//!
//! [`MAX_STRETCH`]: super::strain::MAX_STRETCH
//! [`MIN_VOLUME_SHARE`]: super::strain::MIN_VOLUME_SHARE

use super::organ_watch::OrganWatch;
use super::strain::Strain;
use crate::World;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{CellEvent, PeriodLog};
use glam::DVec3;
use trocar_scene::Side;

/// Largest distance of an instrument from the most strained tissue at which it is the cause (m).
const NEAR: f64 = 0.03;

/// The arm whose instrument is at the strained part of `organ`: one that only presses before one
/// that holds, then the nearest.
pub(super) fn instrument_at(world: &World, arms: &[ArmUnit], strain: &Strain, organ: usize) -> Option<Side> {
    let near = arms.iter().filter(|arm| is_at(world, arm, strain.at, organ));
    let ranked = near.map(|arm| (arm.model.side, (arm.holds(organ), arm.distance(strain.at))));
    ranked.min_by(|(_, a), (_, b)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(side, _)| side)
}

/// Whether the instrument of `arm` may be the cause of a strain of `organ` at `place` (m).
pub(super) fn is_at(world: &World, arm: &ArmUnit, place: DVec3, organ: usize) -> bool {
    let meets = arm.meets_tissue() || world.is_punctured(organ, arm.model.tools.gripper);
    meets && (arm.distance(place) < NEAR || arm.holds(organ))
}

/// Counts tissue at the instrument of `arm` that is strained too much.
pub(super) fn warn(arm: Option<Side>, strain: &Strain, organ: &str, watch: &mut OrganWatch, log: &mut PeriodLog) {
    watch.overstretched &= strain.lasts();
    let Some(arm) = arm.filter(|_| strain.is_too_much() && !watch.overstretched) else { return };
    watch.overstretched = true;
    log.rules.overstretched += 1;
    let Strain { stretch, volume, .. } = *strain;
    log.events.push(CellEvent::Overstretched { arm, organ: organ.to_owned(), stretch, volume });
}
