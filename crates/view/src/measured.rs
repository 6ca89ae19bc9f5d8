//! Measurements for devices, in the words of the Collaborative Robotics Toolkit (CRTK).

use crate::error::Result;
use crate::operator::{Shown, arm_of};
use crate::outbox::Outgoing;
use crate::protocol::ArmName;
use crate::shapes::pose_numbers;
use serde_json::{Map, json};
use trocar_robot::wrench::ForceKind;
use trocar_task::Episode;

/// The message `measured`, after `step` periods of `episode`. `shown` has the newest command of an
/// arm that was applied, `actor` who moves it.
pub(crate) fn message(
    episode: &Episode,
    step: usize,
    shown: impl Fn(ArmName) -> Option<Shown>,
    actor: impl Fn(ArmName) -> &'static str,
) -> Result<Outgoing> {
    let cell = episode.cell();
    let mut arms = Map::new();
    for arm in cell.observe() {
        let name = arm.side.name();
        let commanded = cell.workspace(name)?.tip(&arm.commanded);
        let wrench = arm.force.wrench;
        let force: Vec<f64> = wrench.force.to_array().into_iter().chain(wrench.torque.to_array()).collect();
        let kind = if arm.force.kind == ForceKind::Constraint { "constraint" } else { "contact" };
        let said = json!({
            "measured_cp": pose_numbers(&arm.tip), "setpoint_cp": pose_numbers(&commanded),
            "measured_js": arm.measured.0[..4], "setpoint_js": arm.commanded.0[..4],
            "jaw_measured_js": arm.measured.jaw(), "jaw_setpoint_js": arm.commanded.jaw(),
            "measured_cf": force, "force_kind": kind, "seq": shown(arm_of(arm.side)).map(|s| s.seq),
            "actor": actor(arm_of(arm.side)),
        });
        arms.insert(name.to_owned(), said);
    }
    Ok(Outgoing::text(&json!({"type": "measured", "step": step, "time_s": episode.time(), "arms": arms})))
}
