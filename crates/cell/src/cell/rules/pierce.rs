//! Rule: an instrument that has gone through the surface of an organ is not felt.
//!
//! Tissue touches with the vertices of its surface. A blade that presses hard enough opens a
//! triangle so far that it goes through between the vertices, and from within it would drag them
//! along without end. Real tissue is pierced by then. So as soon as the axis of a convex part lies
//! inside an organ, deeper than the part is thick, contact of the instrument is disabled. What the
//! jaws hold may bulge round them and does not count.

use super::scope::Scope;

pub(super) fn apply(scope: &mut Scope<'_>) {
    for k in 0..scope.arms.len() {
        let arm = &scope.arms[k];
        if !arm.meets_tissue() || arm.state.contact_disabled {
            continue;
        }
        if let Some(organ) = arm.pierces(scope.world) {
            scope.log.rules.pierced += 1;
            scope.disable_contact(k, organ);
        }
    }
}
