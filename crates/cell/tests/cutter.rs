//! Scissors that close on a tube held beyond them part it.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_cell::{Gripper, MAX_ANGLE, World};
use trocar_testing::tube::{HALF_LENGTH, ONE_END, specimen};
use trocar_tissue::{Compliance, Grasp, SolverSettings, ToolMotion};

/// Volume of all bodies as they are now (m3).
fn volume(world: &World) -> f64 {
    let of = |k: usize| {
        let (tets, vertices) = (world.model.bodies()[k].tets().to_vec(), world.state.positions(&world.model, k));
        let mesh = trocar_geometry::TetMesh { tets, vertices };
        (0..mesh.tets.len()).map(|t| mesh.tet_volume(t)).sum::<f64>()
    };
    (0..world.model.bodies().len()).map(of).sum()
}

/// Lifts the tube by its free end, cuts it in the middle, goes on; the hash at the end.
fn resect(opening: f64) -> (World, usize, f64, f64) {
    let mut world = World::new(&specimen(ONE_END), SolverSettings::default(), 1).unwrap();
    let up = world.up;
    let over = |x: f64| Gripper::over(x * DVec3::X, up, DVec3::X, opening);
    let (holder, cutter) = (over(0.7 * HALF_LENGTH), over(0.0));
    let held: Vec<u32> =
        (0..world.model.bodies()[0].len() as u32).filter(|i| world.axes[0].s[*i as usize] > 0.8).collect();
    let closing = DVec3::Y;
    let compliance =
        Compliance { stiffness: 500.0, closing, jaw_force: 0.5, friction: 0.6, tear_force: 5.0, blades: None };
    let grasp = Grasp::capture(&world.model, &world.state, 0, &held, 0, &holder.pose).compliant(compliance);
    world.state.grasps.push(grasp);
    let mut pose = holder.pose;
    let mut walk = |world: &mut World, frames: usize, rise: f64| {
        for _ in 0..frames {
            let from = pose;
            pose.translation += rise * up;
            let report = world.step(&[ToolMotion { from, to: pose }]);
            assert_eq!((report.inverted, report.divergence), (0, None));
        }
    };
    walk(&mut world, 30, 1e-4);
    let before = volume(&world);
    let pieces = world.sever(&cutter.cut(0)).unwrap();
    let after = volume(&world);
    walk(&mut world, 60, 1e-4);
    (world, pieces.len(), before, after)
}

#[test]
fn a_tube_that_is_cut_through_falls_into_two_bodies() {
    let (world, pieces, before, after) = resect(MAX_ANGLE);
    assert_eq!((pieces, world.model.bodies().len(), world.axes.len()), (2, 2, 2));
    assert_eq!(world.model.bodies()[1].name(), "tube.1");
    assert!((after / before - 1.0).abs() < 1e-6, "{before} m3 and {after} m3");
    // What is held has risen by what the tool rose since; the rest has not.
    let rise = |k: usize| {
        let nodes: Vec<u32> = (0..world.model.bodies()[k].len() as u32).collect();
        let rest = world.model.bodies()[k].rest_positions().iter().sum::<DVec3>() / nodes.len() as f64;
        (world.state.centroid(&world.model, k, &nodes) - rest).dot(world.up)
    };
    assert_eq!(world.state.grasps.iter().map(|g| g.body).collect::<Vec<_>>(), [1]);
    assert!(rise(1) > 6e-3 && rise(0).abs() < 1e-3);
    assert_eq!(world.state.hash(), resect(MAX_ANGLE).0.state.hash());
}

#[test]
fn blades_that_do_not_reach_all_of_it_cut_a_part() {
    // Half open: 2.7 mm to either side at the tips.
    let (world, pieces, before, after) = resect(0.25);
    assert_eq!((pieces, world.model.bodies().len()), (1, 1));
    assert!((after / before - 1.0).abs() < 1e-6);
}
