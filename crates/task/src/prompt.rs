//! The instruction of a task, in words, for policies that read text.

use trocar_scene::{InstrumentKind, Scene};

/// The instruction of the task of `scene`, with the sides of the arms that hold the first grasper
/// and the first cutter.
///
/// This is the `prompt` that policies are shown, the `task_description` of Python's environments
/// and the task in datasets.
pub fn prompt(scene: &Scene) -> String {
    let with = |kind: InstrumentKind| match scene.arm_with(kind) {
        Some(arm) => format!("the {} instrument", arm.name.name()),
        None => "an instrument".to_owned(),
    };
    let definition = scene.task.definition().unwrap_or_default();
    if definition.prompt.is_empty() {
        let stages: Vec<&str> = definition.stages.iter().map(|s| s.name.as_str()).collect();
        return format!("{}: {}", scene.task.name.name(), stages.join(", "));
    }
    definition
        .prompt
        .replace("{organ}", &scene.task.organ)
        .replace("{grasper}", &with(InstrumentKind::Grasper))
        .replace("{cutter}", &with(InstrumentKind::Cutter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_scene::{Side, TaskName};

    #[test]
    fn the_arms_are_those_that_hold_the_instruments() {
        let mut scene = Scene::read("cell-a").unwrap();
        let said = prompt(&scene);
        assert!(said.contains("grasp the appendix with the left instrument"), "{said}");
        assert!(said.contains("close the right instrument's blades"), "{said}");
        for arm in &mut scene.arms {
            arm.name = if arm.name == Side::Left { Side::Right } else { Side::Left };
        }
        let said = prompt(&scene);
        assert!(said.contains("grasp the appendix with the right instrument"), "{said}");
        assert!(said.contains("close the left instrument's blades"), "{said}");
        scene.task.name = TaskName::GraspLift;
        assert_eq!(prompt(&scene), "grasp the appendix with the right instrument, lift it and hold it");
    }
}
