//! What is taken to be in the mouth: the 15 placements of a synthetic tube, and those where
//! nothing is.

use glam::DVec3;
use trocar_cell::{CONTACT_SKIN, Gripper, JawRegion, MAX_ANGLE, World, attached, clusters};
use trocar_testing::tube::{HALF_LENGTH, ONE_END, RADIUS, specimen};
use trocar_tissue::SolverSettings;

const REACH: f64 = 0.009;

/// Jaws over the tube at `x` (m) along it, `aside` of its axis and `above` of where they hold it in
/// mid-mouth.
fn jaws(x: f64, aside: f64, above: f64, angle: f64) -> Gripper {
    let up = -DVec3::Z;
    let mut gripper = Gripper::over(x * DVec3::X, up, DVec3::X, angle);
    gripper.pose.translation += above * up + gripper.pose.rotation * (aside * DVec3::Y);
    gripper
}

#[test]
fn fifteen_placements_of_a_tube() {
    let world = World::new(&specimen(ONE_END), SolverSettings::default(), 1).unwrap();
    let all = clusters(&world, 0);
    let free = all[0].s..=all[all.len() - 1].s;
    for place in 0..5 {
        let s = free.start() + (free.end() - free.start()) * f64::from(place) / 4.0;
        let x = (2.0 * s - 1.0) * HALF_LENGTH;
        for aside in [-0.003, 0.0, 0.003] {
            let gripper = jaws(x, aside, 0.0, MAX_ANGLE);
            let tissue =
                JawRegion::of(&gripper).tissue_of(&world, 0).unwrap_or_else(|| panic!("nothing at {x}, {aside}"));
            assert!((tissue.centroid.x - x).abs() < 0.001 && tissue.gap > CONTACT_SKIN, "{tissue:?}");
            let cluster = attached(&world, 0, tissue.centroid, REACH).unwrap();
            let nearest = all
                .iter()
                .min_by(|a, b| {
                    let to = |c: &trocar_cell::Cluster| c.centroid(&world, 0).distance(tissue.centroid);
                    to(a).total_cmp(&to(b))
                })
                .unwrap();
            assert_eq!(cluster.s, nearest.s, "at {x}, {aside}");
            assert!((cluster.s - s).abs() < 0.12, "attached at {}, closed at {s}", cluster.s);
        }
    }
}

#[test]
fn a_tube_outside_the_mouth_is_not_grasped() {
    let world = World::new(&specimen(ONE_END), SolverSettings::default(), 1).unwrap();
    let none = |gripper: Gripper| assert!(JawRegion::of(&gripper).tissue_of(&world, 0).is_none(), "{gripper:?}");
    let some = |gripper: Gripper| assert!(JawRegion::of(&gripper).tissue_of(&world, 0).is_some(), "{gripper:?}");
    // Beside it: all on one side of the closing plane.
    some(jaws(0.0, RADIUS - 0.0005, 0.0, MAX_ANGLE));
    none(jaws(0.0, RADIUS + 0.0005, 0.0, MAX_ANGLE));
    none(jaws(0.0, -RADIUS - 0.0005, 0.0, MAX_ANGLE));
    // Above it: the tips are 9.5 mm below mid-mouth. And so low that the pivot is in it and beyond.
    some(jaws(0.0, 0.0, 0.0095 + RADIUS - 0.001, MAX_ANGLE));
    none(jaws(0.0, 0.0, 0.0095 + RADIUS + 0.0005, MAX_ANGLE));
    none(jaws(0.0, 0.0, -0.0095 - RADIUS - 0.0005, MAX_ANGLE));
    // Beyond its end.
    some(jaws(HALF_LENGTH, 0.0, 0.0, MAX_ANGLE));
    none(jaws(HALF_LENGTH + 0.003, 0.0, 0.0, MAX_ANGLE));
    // Closed on nothing but skin.
    none(jaws(0.0, 0.0, 0.0, 0.1));
}

#[test]
fn tissue_too_far_from_every_cluster_is_not_attached() {
    let world = World::new(&specimen(ONE_END), SolverSettings::default(), 1).unwrap();
    let tip = clusters(&world, 0).pop().unwrap().centroid(&world, 0);
    assert!(attached(&world, 0, tip + 0.0119 * DVec3::Y, REACH).is_some());
    assert!(attached(&world, 0, tip + 0.0121 * DVec3::Y, REACH).is_none());
}
