//! Rule: contact of an instrument that has pierced an organ is disabled.
//!
//! Contact of tissue is at the vertices of its surface. A blade that presses hard can stretch a
//! triangle so far that it passes between the vertices; from inside it would drag them along
//! without limit. Real tissue would be pierced. So contact of an instrument is disabled when the
//! axis of one of its convex parts is inside an organ, deeper than the part is thick. Held tissue
//! may bulge round the jaws and does not count.

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
