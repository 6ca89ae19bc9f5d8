//! Measurements for devices, in the words of the Collaborative Robotics Toolkit (CRTK).

use crate::error::Result;
use crate::operator::arm_of;
use crate::outbox::Outgoing;
use crate::shapes::pose_numbers;
use crate::show::Show;
use serde_json::{Map, json};
use trocar_robot::wrench::ForceKind;

/// The message `measured`.
pub(crate) fn message(show: &Show) -> Result<Outgoing> {
    let cell = show.episode.cell();
    let mut arms = Map::new();
    for arm in cell.observe() {
        let name = arm.side.name();
        let commanded = cell.workspace(name)?.tip(&arm.commanded);
        let wrench = arm.force.wrench;
        let force: Vec<f64> = wrench.force.to_array().into_iter().chain(wrench.torque.to_array()).collect();
        let kind = if arm.force.kind == ForceKind::Constraint { "constraint" } else { "contact" };
        let shown = show.live.as_ref().and_then(|live| live.operators.shown(arm_of(arm.side)));
        let said = json!({
            "measured_cp": pose_numbers(&arm.tip), "setpoint_cp": pose_numbers(&commanded),
            "measured_js": arm.measured.0[..4], "setpoint_js": arm.commanded.0[..4],
            "jaw_measured_js": arm.measured.jaw(), "jaw_setpoint_js": arm.commanded.jaw(),
            "measured_cf": force, "force_kind": kind, "seq": shown.map(|s| s.seq),
            "actor": show.actor(arm_of(arm.side)),
        });
        arms.insert(name.to_owned(), said);
    }
    let step = show.at;
    Ok(Outgoing::text(&json!({"type": "measured", "step": step, "time_s": show.episode.time(), "arms": arms})))
}
