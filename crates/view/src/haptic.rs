//! Local models of the tissue, for devices that render its force.

use crate::error::Result;
use crate::operator::{Operators, arm_of};
use crate::outbox::Outgoing;
use crate::shapes::pose_numbers;
use serde_json::json;
use trocar_cell::Cell;

/// The messages `haptic` of all arms, after `part` tissue frames of the period `step`.
pub(crate) fn haptic(cell: &mut Cell, operators: Option<&Operators>, step: usize, part: u32) -> Result<Vec<Outgoing>> {
    let time_s = cell.time() + f64::from(part % cell.frames()) * trocar_cell::FRAME;
    let mut all = Vec::new();
    for (k, (side, _)) in cell.arms().into_iter().enumerate() {
        let model = cell.haptic_model(side.name())?;
        let setpoint = cell.workspace(side.name())?.tip(&cell.setpoint(side.name())?);
        let force: Vec<f64> = model.wrench.force.to_array().into_iter().chain(model.wrench.torque.to_array()).collect();
        let shown = operators.and_then(|o| o.shown(arm_of(side)));
        all.push(Outgoing::text(&json!({
            "type": "haptic", "arm": side.name(), "step": step, "part": part, "time_s": time_s,
            "pose": pose_numbers(&model.tip), "force": force, "stiffness": model.stiffness.as_flattened(),
            "setpoint": pose_numbers(&setpoint), "held": cell.carried(k).is_some(), "seq": shown.map(|s| s.seq),
        })));
    }
    Ok(all)
}
