//! Consistency of an arm's kinematics and dynamics: finite differences, energy, symmetry and
//! identities.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::{Random, free_fr3, noise, posture, rod, skewed};
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_robot::chain::{ArmState, Drive, JointFactor, Joints, LinkLoad, SerialArm};

fn arms() -> Vec<SerialArm> {
    let base = Pose { rotation: DQuat::from_rotation_x(0.7), translation: DVec3::new(0.3, -0.2, 0.5) };
    let fr3 = free_fr3().with_payload(rod(0.5, 0.2)).unwrap().with_base(base).unwrap();
    vec![fr3, skewed(1), skewed(5), skewed(16).with_base(base).unwrap()]
}

#[test]
fn jacobians_are_the_derivatives_of_the_frames() {
    let mut rng = Random(1);
    for arm in arms() {
        for _ in 0..50 {
            let q = posture(&arm, &mut rng);
            let frames = arm.frames(&q);
            let link = arm.dof() / 2;
            // A point fixed to the link.
            let own = DVec3::new(0.1, -0.2, 0.05);
            let jacobian = frames.jacobian(link, frames.link(link).transform(own));
            for k in 0..arm.dof() {
                const H: f64 = 1e-5;
                let moved = |h: f64| {
                    let mut q = q;
                    q[k] += h;
                    arm.frames(&q).link(link)
                };
                let (ahead, back) = (moved(H), moved(-H));
                let v = (ahead.transform(own) - back.transform(own)) / (2.0 * H);
                let turn = ahead.rotation * back.rotation.inverse();
                let w = DVec3::new(turn.x, turn.y, turn.z) * (turn.w.signum() / H);
                assert!((v - jacobian.linear()[k]).length() < 1e-8 * (1.0 + v.length()));
                assert!((w - jacobian.angular()[k]).length() < 1e-8);
            }
        }
    }
}

#[test]
fn the_mass_matrix_is_symmetric_positive_and_consistent_with_inverse_dynamics() {
    let mut rng = Random(2);
    for arm in arms() {
        let n = arm.dof();
        for _ in 0..100 {
            let (q, qd, qdd) = (posture(&arm, &mut rng), noise(n, 2.0, &mut rng), noise(n, 5.0, &mut rng));
            let d = arm.dynamics(&q, &qd);
            for i in 0..n {
                for j in 0..n {
                    assert_eq!(d.mass_matrix.row(i)[j], d.mass_matrix.row(j)[i]);
                }
            }
            let factor: Option<JointFactor> = d.mass_matrix.factor();
            assert!(factor.is_some());
            // RNEA = M qdd + bias.
            let torque = arm.inverse_dynamics(&q, &qd, &qdd);
            let moved = d.mass_matrix.times(&qdd);
            let size = torque.max_abs();
            for i in 0..n {
                assert!((torque[i] - moved[i] - d.bias[i]).abs() < 1e-12 * size);
            }
            // Forward dynamics is its inverse, and a load on a link acts through the Jacobian.
            let back = arm.forward_dynamics(&q, &qd, &torque, &[]).unwrap();
            let off = (0..n).fold(0.0, |m: f64, i| m.max((back[i] - qdd[i]).abs()));
            assert!(off < 1e-8 * qdd.max_abs(), "{off}");
            let point = d.frames.flange().translation + DVec3::new(0.1, 0.0, 0.2);
            let load = LinkLoad { link: n - 1, point, force: DVec3::new(3.0, -2.0, 1.0), torque: DVec3::Z };
            let row = d.frames.jacobian(n - 1, point).torque(load.force, load.torque);
            let without = Joints::from_fn(n, |i| torque[i] - row[i]);
            let back = arm.forward_dynamics(&q, &qd, &without, &[load]).unwrap();
            let off = (0..n).fold(0.0, |m: f64, i| m.max((back[i] - qdd[i]).abs()));
            assert!(off < 1e-8 * qdd.max_abs(), "{off}");
        }
    }
}

/// The kinetic energy is the sum over links, with speeds from the Jacobians.
#[test]
fn gravity_is_the_slope_of_the_potential_energy() {
    let mut rng = Random(3);
    for arm in arms() {
        for _ in 0..20 {
            let q = posture(&arm, &mut rng);
            let gravity = arm.gravity_torque(&q);
            for k in 0..arm.dof() {
                const H: f64 = 1e-5;
                let at = |h: f64| {
                    let mut q = q;
                    q[k] += h;
                    arm.energy(&q, &arm.zeros()).1
                };
                let slope = (at(H) - at(-H)) / (2.0 * H);
                assert!((slope - gravity[k]).abs() < 1e-7 * (1.0 + gravity.max_abs()), "{slope} {}", gravity[k]);
            }
        }
    }
}

#[test]
fn an_undriven_arm_conserves_energy() {
    let arm = free_fr3().with_payload(rod(0.5, 0.2)).unwrap();
    let start = ArmState { q: arm.home(), qd: noise(7, 1.0, &mut Random(4)) };
    let drive = Drive { torque: arm.zeros(), external: arm.zeros() };
    let energy = |s: &ArmState| {
        let (kinetic, potential) = arm.energy(&s.q, &s.qd);
        kinetic + potential
    };
    // The error is of first order in the step: half the step gives half the error. A wrong term in
    // bias or mass matrix would not.
    let drift = |substeps: usize| {
        let (mut state, mut worst, mut most) = (start, 0.0, 0.0);
        for _ in 0..960 {
            arm.step(&mut state, &drive, &mut [], 1.0 / 480.0, substeps).unwrap();
            worst = f64::max(worst, (energy(&state) - energy(&start)).abs());
            most = f64::max(most, arm.energy(&state.q, &state.qd).0);
        }
        worst / most
    };
    let (fine, finest) = (drift(16), drift(32));
    assert!(finest < 1e-2 && (1.8..2.2).contains(&(fine / finest)), "{fine} {finest}");
}

#[test]
fn a_payload_equals_a_heavier_last_link() {
    let arm = free_fr3();
    let payload = rod(0.5, 0.2);
    let loaded = arm.clone().with_payload(payload).unwrap();
    let mut segments = arm.segments().to_vec();
    let last = segments.last_mut().unwrap();
    last.mass = last.mass.joined(&payload.placed(&arm.flange()));
    let heavy = SerialArm::new("heavy", segments, arm.flange()).unwrap();
    let q = posture(&arm, &mut Random(5));
    assert_eq!(loaded.gravity_torque(&q), heavy.gravity_torque(&q));
    assert_eq!(loaded.mass_matrix(&q), heavy.mass_matrix(&q));
    // A mass 0.2 m beyond the flange loads the wrist.
    assert!((loaded.gravity_torque(&q)[5] - arm.gravity_torque(&q)[5]).abs() > 0.05);
    // With masses 2% lower the gravity torque is 2% lower.
    let light = loaded.clone().with_mass_scaled(0.98, 0.98).unwrap();
    let (a, b) = (light.gravity_torque(&q), loaded.gravity_torque(&q));
    assert!(a.iter().zip(b.iter()).all(|(a, b)| (a - 0.98 * b).abs() < 1e-12));
}
