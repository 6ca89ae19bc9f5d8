//! Inverse kinematics: it reaches reachable poses, reports the remaining error of others, and is
//! smooth.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

mod common;

use common::{Random, between, noise, posture, skewed};
use glam::{DQuat, DVec3};
use std::time::Instant;
use trocar_core::Pose;
use trocar_robot::chain::{InverseOptions, Joints, SerialArm};

fn apart(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b.iter()).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()))
}

fn gap(a: &Pose, b: &Pose) -> (f64, f64) {
    let turn = a.rotation * b.rotation.inverse();
    ((a.translation - b.translation).length(), 2.0 * DVec3::new(turn.x, turn.y, turn.z).length())
}

#[test]
fn every_reachable_pose_is_reached() {
    let arm = SerialArm::franka_fr3().unwrap();
    let mut rng = Random(21);
    let options = InverseOptions { restarts: 300, ..InverseOptions::default() };
    let (mut near, mut worst) = (0, (0.0f64, 0.0f64));
    for _ in 0..1000 {
        let target = arm.frames(&posture(&arm, &mut rng)).flange();
        let found = arm.inverse(&target, &arm.home(), &options).unwrap();
        near += usize::from(found.reached);
        let off = gap(&target, &arm.frames(&found.q).flange());
        // The reported error is the actual error.
        assert!((off.0 - found.translation.length()).abs() < 1e-12);
        arm.posture(&found.q).unwrap();
        if found.reached {
            worst = (worst.0.max(off.0), worst.1.max(off.1));
        }
    }
    assert!(near == 1000 && worst.0 < 1e-7 && worst.1 < 1e-7);
}

#[test]
fn a_near_start_needs_no_restart_and_few_iterations() {
    let arm = SerialArm::franka_fr3().unwrap();
    let mut rng = Random(22);
    let options = InverseOptions::default();
    // A 30 Hz motion of an arm: some millimetres and about a degree a call.
    let mut q = Joints::new(&[0.0, -0.2, 0.0, -2.2, 0.0, 2.0, 0.0]).unwrap();
    let start = arm.frames(&q).flange();
    let (mut reached, mut iterations, mut calls, mut time, mut jump) = (0, 0, 0, 0.0, 0.0f64);
    let wiggle = noise(6, 3.0, &mut rng);
    for k in 0..3000 {
        let t = k as f64 / 30.0;
        let swing = |i: usize, f: f64| (f * t + wiggle[i]).sin() - wiggle[i].sin();
        let translation =
            start.translation + DVec3::new(0.05 * swing(0, 0.9), 0.1 * swing(1, 0.7), 0.05 * swing(2, 1.3));
        let turn = DQuat::from_scaled_axis(DVec3::new(0.2 * swing(3, 0.5), 0.2 * swing(4, 0.8), 0.3 * swing(5, 0.4)));
        let target = Pose { rotation: turn * start.rotation, translation };
        let clock = Instant::now();
        let found = arm.inverse(&target, &q, &options).unwrap();
        time += clock.elapsed().as_secs_f64();
        reached += usize::from(found.reached);
        jump = jump.max(apart(&found.q, &q));
        (q, iterations, calls) = (found.q, iterations + found.iterations, calls + 1);
    }
    let each = time / f64::from(calls) * 1e6;
    println!(
        "warm: {each:.1} us and {:.1} iterations a call, joints move at most {jump:.3} rad",
        iterations as f64 / f64::from(calls)
    );
    assert!(reached == 3000 && jump < 0.1 && each < 40.0, "{each} us, aim 20");
}

#[test]
fn the_elbow_does_not_depend_on_the_path() {
    let arm = SerialArm::franka_fr3().unwrap();
    let mut rng = Random(23);
    let options = InverseOptions { posture_tolerance: 1e-7, iterations: 200, ..InverseOptions::default() };
    for _ in 0..50 {
        let near = noise(7, 0.3, &mut rng);
        let target = arm.frames(&Joints::from_fn(7, |i| arm.home()[i] + near[i])).flange();
        let from = |rng: &mut Random| {
            let off = noise(7, 0.3, rng);
            arm.inverse(&target, &Joints::from_fn(7, |i| arm.home()[i] + off[i]), &options).unwrap()
        };
        let (a, b) = (from(&mut rng), from(&mut rng));
        assert!(a.reached && b.reached);
        assert!(apart(&a.q, &b.q) < 1e-5, "{:?} {:?}", a.q, b.q);
    }
    // The elbow follows the preferred posture.
    let target = arm.frames(&arm.home()).flange();
    let mut preferred = arm.home();
    preferred[2] += 0.6;
    let found = arm.inverse(&target, &arm.home(), &InverseOptions { preferred: Some(preferred), ..options }).unwrap();
    assert!(found.reached && found.q[2] > 0.1, "{:?}", found.q);
}

/// A straight line outwards through the workspace to the stretched arm and beyond: no joint jumps,
/// the flange stays near, and the error is reported.
#[test]
fn it_is_smooth_to_the_end_of_the_workspace_and_beyond() {
    let arm = SerialArm::franka_fr3().unwrap();
    let options = InverseOptions { within: 1.0 / 30.0, ..InverseOptions::default() };
    let mut q = arm.home();
    let start = arm.frames(&q).flange();
    let (mut beyond, mut jump, mut shake, mut last) = (0, 0.0f64, 0.0f64, 0.0);
    for k in 0..900 {
        let target = Pose { translation: start.translation + DVec3::X * (0.001 * k as f64), ..start };
        let found = arm.inverse(&target, &q, &options).unwrap();
        jump = jump.max(apart(&found.q, &q));
        if !found.reached {
            beyond += 1;
            let off = gap(&target, &arm.frames(&found.q).flange());
            assert!((off.0 - found.translation.length()).abs() < 1e-9 && off.0 + off.1 > 1e-8);
            shake = shake.max(last - found.translation.length());
            last = found.translation.length();
        }
        q = found.q;
    }
    assert!(beyond > 100 && jump < 0.18 && last > 0.2 && shake < 5e-3, "{shake}");
}

#[test]
fn binding_limits_are_reported() {
    let arm = SerialArm::franka_fr3().unwrap();
    // Rotated about the flange's axis far beyond the last joint's range.
    let start = arm.frames(&arm.home()).flange();
    let mut q = arm.home();
    let mut bound = false;
    for k in 0..60 {
        let target = Pose { rotation: start.rotation * DQuat::from_rotation_z(-0.06 * f64::from(k)), ..start };
        let found = arm.inverse(&target, &q, &InverseOptions::default()).unwrap();
        arm.posture(&found.q).unwrap();
        bound |= !found.at_limit.is_empty();
        q = found.q;
    }
    assert!(bound);
    let far = Pose { translation: DVec3::new(5.0, 0.0, 0.0), ..start };
    let found = arm.inverse(&far, &arm.home(), &InverseOptions::default()).unwrap();
    assert!(!found.reached && found.translation.length() > 3.0);
    // Numbers that are not finite.
    for target in
        [Pose { translation: DVec3::NAN, ..start }, Pose { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..start }]
    {
        assert!(arm.inverse(&target, &arm.home(), &InverseOptions::default()).is_err());
    }
    assert!(arm.inverse(&start, &Joints::zeros(3), &InverseOptions::default()).is_err());
    assert!(
        arm.inverse(&far, &arm.home(), &InverseOptions { within: 0.0, ..InverseOptions::default() }).unwrap().q
            == arm.home()
    );
}

#[test]
fn arms_of_other_sizes_work() {
    let mut rng = Random(24);
    for n in [1, 3, 6, 12] {
        let arm = skewed(n);
        for _ in 0..20 {
            let goal = noise(n, 0.3, &mut rng);
            let target = arm.frames(&goal).flange();
            let from = Joints::from_fn(n, |i| goal[i] + between(&mut rng, -0.05, 0.05));
            let found = arm
                .inverse(
                    &target,
                    &from,
                    &InverseOptions { iterations: 200, tolerance: [1e-6; 2], ..InverseOptions::default() },
                )
                .unwrap();
            assert!(found.reached, "{n} joints: {found:?}");
        }
    }
}
