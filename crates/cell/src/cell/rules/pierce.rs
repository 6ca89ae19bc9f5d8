//! Rule: contact of an instrument that has pierced an organ is disabled.
//!
//! An instrument that comes through the surface of an organ with less force than punctures it
//! ([`crate::cell::period`]) got there because the mesh or the contact gave way, not tissue: a blade can
//! crush a triangle within a frame. From inside, its contact would drag the surface along without
//! limit. So contact of an instrument is disabled when the axis of one of its convex parts is inside
//! an organ, deeper than the part is thick. Held tissue may bulge round the jaws and does not count.

use super::scope::Scope;

pub(super) fn apply(scope: &mut Scope<'_>) {
    for k in 0..scope.arms.len() {
        let arm = &scope.arms[k];
        if !arm.meets_tissue() || arm.state.contact_disabled {
            continue;
        }
        if let Some((organ, _)) = arm.pierces(scope.world).first() {
            scope.log.rules.pierced += 1;
            scope.disable_contact(k, *organ);
        }
    }
}
