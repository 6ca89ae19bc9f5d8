//! Rule: contact of an instrument is enabled again when it is out of all organs and no organ is
//! strained.

use super::scope::Scope;

pub(super) fn apply(scope: &mut Scope<'_>) {
    let calm = !scope.strains.iter().any(|s| s.lasts());
    for arm in scope.arms.iter_mut().filter(|arm| arm.state.contact_disabled) {
        if calm && arm.pierces(scope.world).is_empty() {
            arm.state.contact_disabled = false;
            scope.log.rules.reconnected += 1;
        }
    }
}
