//! Checks of the task, its gates and the safety limits.

use super::{Checked, names, number, numbers, problem};
use crate::check::unit::show;
use crate::{BUILTIN_TASKS, InstrumentKind, Scene};
use trocar_specimen::nearest;

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
            ("puncture_force_n", safety.puncture_force_n, 0.1..=1000.0),
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
    own_stages(scene)?;
    let name = task.name.name();
    let context = scene.task_context().map_err(|_| {
        let known: Vec<&str> = BUILTIN_TASKS.iter().map(|b| b.name.name()).collect();
        let hint = nearest(name, known.iter().copied()).map_or_else(String::new, |n| format!("; did you mean '{n}'?"));
        let reason = format!(" is '{name}', which has no stages; write [[task.stage]], or name a built-in task: ");
        problem("task.name", reason + &known.join(", ") + &hint)
    })?;
    let program = context.program(gates).map_err(|m| problem(format!("task.{}", m.field), m.reason))?;
    let needs = [
        (program.needs_grasper, InstrumentKind::Grasper, "grasper"),
        (program.needs_cutter, InstrumentKind::Cutter, "cutter"),
    ];
    match needs.iter().find(|(needed, kind, _)| *needed && scene.arm_with(*kind).is_none()) {
        Some((.., what)) => {
            Err(problem("task.name", format!(" is '{name}', but no arm has a {what}; it needs an arm with a {what}")))
        }
        None => Ok(()),
    }
}

/// Most constants of a task.
const MAX_CONSTANTS: usize = 32;

/// Checks what scenes say of stages of their own, but for their expressions.
fn own_stages(scene: &Scene) -> Checked {
    let task = &scene.task;
    names("task.stage", task.stages.iter().map(|s| s.name.as_str()))?;
    names("task.abort", task.aborts.iter().map(|a| a.name.as_str()))?;
    for (k, stage) in task.stages.iter().enumerate() {
        number(&format!("task.stage[{k}].share"), stage.share, &(0.0..=1000.0))?;
    }
    if !task.stages.is_empty() && task.stages.iter().all(|s| s.share == 0.0) {
        return Err(problem(
            "task.stage[0].share",
            " is 0, as all others; one stage or more must have a share".to_owned(),
        ));
    }
    if task.constants.len() > MAX_CONSTANTS {
        let reason = format!(" has {} entries; it must have at most {MAX_CONSTANTS}", task.constants.len());
        return Err(problem("task.constants", reason));
    }
    for (own, value) in &task.constants {
        let field = format!("task.constants.{own}");
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if own.is_empty() || own.len() > 40 || !own.chars().all(legal) {
            let shown: String = own.chars().take(60).flat_map(char::escape_default).collect();
            let reason = format!(" has '{shown}'; a name must be 1 to 40 lower-case letters, digits and '_'");
            return Err(problem("task.constants", reason));
        }
        if task.gates.named().iter().any(|(gate, _)| gate == own) {
            return Err(problem(field, " is also a gate; give it another name".to_owned()));
        }
        if !value.is_finite() || value.abs() > 1e9 {
            return Err(problem(field, format!(" is {value}; it must be finite and at most 1e9")));
        }
    }
    Ok(())
}
