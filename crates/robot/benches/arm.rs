//! What an arm costs: a step of its dynamics, its mass matrix and its inverse kinematics.
//! `cargo bench -p trocar-robot`.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first error")]

use divan::Bencher;
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::chain::{ArmState, Drive, InverseOptions, SerialArm};

fn main() {
    divan::main();
}

/// One step of 1/480 s with two substeps, near the home posture, under gravity compensation.
#[divan::bench]
fn step(bencher: Bencher<'_, '_>) {
    let arm = SerialArm::franka_fr3().unwrap();
    let mut state = ArmState::at_rest(arm.home());
    let drive = Drive { torque: arm.gravity_torque(&arm.home()), external: arm.zeros() };
    bencher.bench_local(|| arm.step(&mut state, &drive, &mut [], 1.0 / 480.0, 2).unwrap());
}

/// The pose of every link.
#[divan::bench]
fn forward_kinematics(bencher: Bencher<'_, '_>) {
    let arm = SerialArm::franka_fr3().unwrap();
    let home = arm.home();
    bencher.bench_local(|| arm.frames(divan::black_box(&home)).flange());
}

/// The joints for a flange pose 5 mm away, as in one control period.
#[divan::bench]
fn inverse_kinematics(bencher: Bencher<'_, '_>) {
    let arm = SerialArm::franka_fr3().unwrap();
    let home = arm.home();
    let flange = arm.frames(&home).flange();
    let target = Pose { translation: flange.translation + DVec3::new(0.003, 0.0, 0.004), ..flange };
    let options = InverseOptions::default();
    bencher.bench_local(|| arm.inverse(divan::black_box(&target), &home, &options).unwrap());
}
