//! Warns of an instrument that has pierced an organ: the axis of one of its convex parts is inside.
//!
//! Contact keeps tissue outside of an instrument's axis, and an instrument that presses harder than
//! tissue bears punctures it. An axis that comes in with less force did so because the mesh or the
//! contact yielded. Held tissue may bulge around the jaws and does not count. Sheared tissue does
//! not count either.

use crate::World;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{CellEvent, PeriodLog};

pub(super) fn warn(world: &World, arms: &mut [ArmUnit], log: &mut PeriodLog) {
    for arm in arms {
        // Tissue that cannot move presses without a contact of the tissue's step.
        let near = arm.state.pierces || arm.meets_tissue() || arm.state.pressed.is_any();
        let organ = if near { arm.pierces(world).first().map(|(organ, _)| *organ) } else { None };
        if let Some(organ) = organ.filter(|_| !arm.state.pierces) {
            log.rules.pierced += 1;
            let organ = world.model.bodies()[organ].name().to_owned();
            log.events.push(CellEvent::Pierced { arm: arm.model.side, organ });
        }
        arm.state.pierces = organ.is_some();
    }
}
