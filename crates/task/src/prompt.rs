//! What a task asks for, in words: for policies that read.

use trocar_scene::{InstrumentKind, Scene, TaskName};

/// What the task of `scene` asks for, with the arms that hold the first grasper and the first
/// cutter in it by their sides.
///
/// This is the `prompt` that policies are shown, the `task_description` of Python's environments
/// and the task in datasets.
pub fn prompt(scene: &Scene) -> String {
    let organ = &scene.task.organ;
    let with = |kind: InstrumentKind| match scene.arm_with(kind) {
        Some(arm) => format!("the {} instrument", arm.name.name()),
        None => "an instrument".to_owned(),
    };
    let grasper = with(InstrumentKind::Grasper);
    match scene.task.name {
        TaskName::AppendixResection => {
            let cutter = with(InstrumentKind::Cutter);
            format!("grasp the {organ} with {grasper}, lift it, and close {cutter}'s blades through it")
        }
        TaskName::GraspLift => format!("grasp the {organ} with {grasper}, lift it and hold it"),
        TaskName::PortReach => "move the instruments through their ports to one place after the other".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_scene::Side;

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
