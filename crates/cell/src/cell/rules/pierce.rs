//! Warns of an instrument that has pierced an organ: the axis of one of its convex parts is inside.
//!
//! Contact keeps tissue outside of an instrument's axis up to the forces that arms exert. Held
//! tissue may bulge round the jaws and does not count, nor does what blades shear.

use crate::World;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{CellEvent, PeriodLog};

pub(super) fn warn(world: &World, arms: &mut [ArmUnit], log: &mut PeriodLog) {
    for arm in arms {
        let organ = if arm.state.pierces || arm.meets_tissue() { arm.pierces(world) } else { None };
        if let Some(organ) = organ.filter(|_| !arm.state.pierces) {
            log.rules.pierced += 1;
            let organ = world.model.bodies()[organ].name().to_owned();
            log.events.push(CellEvent::Pierced { arm: arm.model.side, organ });
        }
        arm.state.pierces = organ.is_some();
    }
}
