//! The oracle's energies, and its states handed to steppers.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, nodes, tissue};
use trocar_tissue_reference::{Oracle, OracleState};

const SUBSTEP: f64 = FRAME / 8.0;

/// Moved as a whole from the predictor, a body has only the energy of inertia, 1/2 M d^2/dt^2; the
/// exact step has less than any other.
#[test]
fn energies_are_inertias_where_nothing_is_strained_and_least_at_the_step() {
    let mesh = block([2, 2, 2], 4e-3);
    let free = model(&mesh, tissue(12e3), Vec::new(), GRAVITY);
    let before = OracleState::new(&free);
    let oracle = Oracle::new(&free);
    let mass: f64 = (0..mesh.vertices.len()).map(|i| free.bodies()[0].mass(i)).sum();
    let off = DVec3::new(1e-4, -2e-4, 5e-5);
    let mut moved = before.clone();
    moved.positions_mut(0).iter_mut().for_each(|x| *x += SUBSTEP * SUBSTEP * GRAVITY + off);
    let energy = oracle.energy(&free, &before, &moved, SUBSTEP).unwrap()[0];
    let inertia = 0.5 * mass * off.length_squared() / (SUBSTEP * SUBSTEP);
    assert!((energy / inertia - 1.0).abs() < 1e-6, "{energy} J, {inertia} J");

    let held = model(&mesh, tissue(12e3), nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let mut oracle = Oracle::new(&held);
    let mut reached = before;
    for _ in 0..3 {
        let before = reached.clone();
        oracle.step(&held, &mut reached, SUBSTEP, &[]).unwrap();
        let least = oracle.energy(&held, &before, &reached, SUBSTEP).unwrap()[0];
        for node in nodes(&mesh, |p| p.z > 0.0) {
            for axis in DVec3::AXES {
                let mut beside = reached.clone();
                beside.positions_mut(0)[node as usize] += 1e-6 * axis;
                assert!(
                    oracle.energy(&held, &before, &beside, SUBSTEP).unwrap()[0] > least,
                    "node {node} along {axis}"
                );
            }
        }
    }
    let mut turned = reached.clone();
    turned.positions_mut(0).iter_mut().for_each(|x| x.z = -x.z);
    assert!(!oracle.energy(&held, &reached, &turned, SUBSTEP).unwrap()[0].is_finite());
    assert!(oracle.energy(&held, &reached, &reached, 0.0).is_err());
}

/// A state goes to the stepper's and back with no more than its rounding.
#[test]
fn states_go_both_ways() {
    let mesh = block([2, 2, 3], 4e-3);
    let held = model(&mesh, tissue(3e3), nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let mut oracle = Oracle::new(&held);
    let mut now = OracleState::new(&held);
    let mut before = now.clone();
    for _ in 0..5 {
        before = now.clone();
        oracle.step(&held, &mut now, SUBSTEP, &[]).unwrap();
    }
    let back = OracleState::from_state(&held, &now.to_state(&held, &before, SUBSTEP).unwrap());
    let off = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(off(back.positions(0), now.positions(0)) < 2e-9);
    assert!(off(back.velocities(0), now.velocities(0)) < 1e-7);
    assert!(now.velocities(0).iter().any(|v| v.length() > 1e-2), "it moves");
    assert_eq!(back.time, now.time);
    assert!(now.to_state(&held, &before, f64::NAN).is_err());
}
