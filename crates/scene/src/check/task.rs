//! Checks of the task, its gates and the safety limits.

use super::{Checked, numbers, problem};
use crate::check::unit::show;
use crate::{InstrumentKind, Scene, TaskName};

pub(super) fn check(scene: &Scene) -> Checked {
    let (task, gates) = (&scene.task, &scene.task.gates);
    numbers("task", &[("episode_s", task.episode_s, 0.1..=3600.0)])?;
    numbers(
        "task.gates",
        &[
            ("grasp_from", gates.grasp_from, 0.0..=1.0),
            ("grasp_to", gates.grasp_to, 0.0..=1.0),
            ("lift_mm", gates.lift_mm, 0.1..=100.0),
            ("lift_s", gates.lift_s, 0.0..=60.0),
            ("positioning_mm", gates.positioning_mm, 0.1..=100.0),
            ("cut_open", gates.cut_open, 0.0..=1.0),
            ("cut_closed", gates.cut_closed, 0.0..=1.0),
        ],
    )?;
    let safety = &scene.safety;
    numbers(
        "safety",
        &[
            ("rcm_threshold_mm", safety.rcm_threshold_mm, 0.01..=50.0),
            ("rcm_abort_mm", safety.rcm_abort_mm, 0.01..=50.0),
            ("force_limit_n", safety.force_limit_n, 0.1..=1000.0),
        ],
    )?;
    let ordered = [
        ("task.gates.grasp_to", gates.grasp_to, "grasp_from", gates.grasp_from),
        ("task.gates.cut_open", gates.cut_open, "cut_closed", gates.cut_closed),
        ("safety.rcm_abort_mm", safety.rcm_abort_mm, "rcm_threshold_mm", safety.rcm_threshold_mm),
    ];
    for (field, high, other, low) in ordered {
        if high <= low {
            return Err(problem(field, format!(" is {}; it must be greater than {other} ({})", show(high), show(low))));
        }
    }
    let needs: &[(InstrumentKind, &str)] = match task.name {
        TaskName::AppendixResection => &[(InstrumentKind::Grasper, "grasper"), (InstrumentKind::Cutter, "cutter")],
        TaskName::GraspLift => &[(InstrumentKind::Grasper, "grasper")],
        TaskName::PortReach => &[],
    };
    match needs.iter().find(|(kind, _)| scene.arm_with(*kind).is_none()) {
        Some((_, what)) => {
            let name = task.name.name();
            Err(problem("task.name", format!(" is '{name}', but no arm has a {what}; it needs an arm with a {what}")))
        }
        None => Ok(()),
    }
}
