//! Warns of an organ that stays strained with no instrument near it.
//!
//! Tissue that snaps back may stay folded: elements that would have to invert to unfold block each
//! other.

use super::organ_watch::OrganWatch;
use super::strain::{MAX_FRAMES_ALONE, Strain};
use crate::cell::report::{CellEvent, PeriodLog};
use trocar_scene::Side;

/// Counts `organ` once if it stays strained with no `arm` near it.
pub(super) fn warn(arm: Option<Side>, strain: &Strain, organ: &str, watch: &mut OrganWatch, log: &mut PeriodLog) {
    if arm.is_some() || !strain.lasts() {
        watch.frames_alone = 0;
        return;
    }
    watch.frames_alone = watch.frames_alone.saturating_add(1);
    if watch.frames_alone == MAX_FRAMES_ALONE {
        log.rules.folded += 1;
        let Strain { stretch, volume, .. } = *strain;
        log.events.push(CellEvent::Folded { organ: organ.to_owned(), stretch, volume });
    }
}
