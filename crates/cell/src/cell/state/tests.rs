//! Hash and restore carry every field of an arm and of the cell.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use super::*;
use crate::GraspDesign;
use crate::bite::Bite;
use crate::cell::action::{Action, ActionSpace};
use crate::cell::arm::{ArmState, Held, Wanted};
use crate::hold::Hold;
use crate::severance::Parting;
use glam::{DVec3, DVec4};
use trocar_testing::tube::{self, ONE_END, specimen};
use trocar_tissue::{Hole, ToolForce};

fn cell() -> Cell {
    let mut scene = tube::scene();
    scene.instruments.truncate(1);
    scene.arms = vec![trocar_scene::Arm::free(trocar_scene::Side::Left, "grasper", [0.0, 0.46, 0.12])];
    scene.task.name = trocar_scene::TaskName::GraspLift;
    scene.task.organ = "tube".to_owned();
    Cell::new(&scene, &specimen(ONE_END), 1).unwrap()
}

/// A force on the shaft (N).
fn force_on_shaft(force: f64) -> [ToolForce; 3] {
    let mut forces = [ToolForce::default(); 3];
    forces[0].contact.force.x = force;
    forces
}

/// One change for each field. A new field does not compile until it is named here.
fn changes(state: &ArmState, hold: &Hold) -> Vec<(&'static str, ArmState)> {
    let ArmState {
        wanted: _,
        commanded: _,
        held_back: _,
        guard: _,
        guarded: _,
        gripper: _,
        design: _,
        jaw: _,
        jaw_rate: _,
        exchange: _,
        solid: _,
        pressed: _,
        forces: _,
        scissors: _,
        shears: _,
        bite: _,
        parting: _,
        held: _,
        pierces: _,
        rcm_peak: _,
        rcm_reported: _,
        standing: _,
    } = state;
    let changed = |change: &dyn Fn(&mut ArmState)| {
        let mut other = state.clone();
        change(&mut other);
        other
    };
    vec![
        ("wanted", changed(&|s| s.wanted = Wanted::Joints(0.25))),
        ("commanded", changed(&|s| s.commanded.0[2] += 1e-9)),
        ("held_back", changed(&|s| s.held_back ^= true)),
        ("guard", changed(&|s| s.guard.end_frame([DVec4::X, DVec4::ZERO], Default::default(), [DVec4::Y; 2], 10.0))),
        ("guarded", changed(&|s| s.guarded ^= true)),
        ("solid", changed(&|s| s.solid.add(1e-9 * DVec3::X))),
        ("pressed", changed(&|s| s.pressed.end_frame(8, [force_on_shaft(1e-9)].into_iter()))),
        ("gripper", changed(&|s| s.gripper.pose.translation.x += 1e-9)),
        ("jaw angle", changed(&|s| s.gripper.jaw_angle += 1e-9)),
        ("design", changed(&|s| s.design = GraspDesign::RestPose)),
        ("jaw", changed(&|s| s.jaw.budget += 0.1)),
        ("jaw_rate", changed(&|s| s.jaw_rate += 1e-9)),
        ("exchange", changed(&|s| s.exchange.limited ^= true)),
        ("forces", changed(&|s| s.forces[1].pressing += 1e-9)),
        ("scissors", changed(&|s| s.scissors = crate::Scissors::new(0.9, 0.1))),
        ("shears", changed(&|s| s.shears = Some(0.5))),
        ("bite", changed(&|s| s.bite = Some(Bite::new(0, 0.5, 300.0, 0.01, vec![0.0; 3])))),
        ("parting", changed(&|s| s.parting = Some(Parting::default()))),
        ("standing", changed(&|s| s.standing = 3)),
        ("held", changed(&|s| s.held = Some(Held { organ: 0, s: 0.5, hold: hold.clone(), opening: 0.1 }))),
        ("pierces", changed(&|s| s.pierces ^= true)),
        ("rcm_peak", changed(&|s| s.rcm_peak += 1e-9)),
        ("rcm_reported", changed(&|s| s.rcm_reported[1] ^= true)),
    ]
}

#[test]
fn hash_and_restore_carry_every_field() {
    let mut cell = cell();
    let saved = cell.save();
    let start = saved.hash();
    assert_eq!(cell.hash(), start);
    let mut seen = vec![start];
    let hold = Hold::new(cell.world(), 0, vec![1, 2], &saved.arms[0].0.gripper.pose);
    let mut others: Vec<(&str, CellState)> = changes(&saved.arms[0].0, &hold)
        .into_iter()
        .map(|(field, arm)| {
            let mut other = saved.clone();
            other.arms[0].0 = arm;
            (field, other)
        })
        .collect();
    let changed = |change: &dyn Fn(&mut CellState)| {
        let mut other = saved.clone();
        change(&mut other);
        other
    };
    let CellState { world: _, arms: _, watches: _, touch: _, waiting: _, periods: _ } = &saved;
    others.push(("watches", changed(&|s| s.watches[0].frames_alone += 1)));
    others.push(("touch", changed(&|s| s.touch ^= true)));
    let action = Action { space: ActionSpace::Pivots, numbers: vec![0.0; 5] };
    others.push(("waiting", changed(&|s| s.waiting.0.push_back(None))));
    others.push(("waiting action", changed(&|s| s.waiting.0.push_back(Some(action.clone())))));
    others.push(("periods", changed(&|s| s.periods += 1)));
    cell.step(None).unwrap();
    others.push(("world and drive", cell.save()));
    cell.restore(&saved).unwrap();
    cell.world.state.holes.push(Hole { body: 0, tools: vec![0, 1, 2], nodes: vec![1, 2] });
    others.push(("holes", cell.save()));
    for (field, other) in &others {
        let hash = other.hash();
        assert!(!seen.contains(&hash), "the hash misses {field}");
        seen.push(hash);
        cell.restore(other).unwrap();
        assert_eq!(cell.hash(), hash, "restore misses {field}");
        cell.restore(&saved).unwrap();
        assert_eq!(cell.hash(), start, "{field} stays after restore");
    }
}
