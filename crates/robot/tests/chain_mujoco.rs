//! Comparison of arms with MuJoCo: kinematics, mass matrix, bias and gravity in random states, and
//! driven motion. Skipped, with a message, without MuJoCo or the FR3's files.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

mod common;

use common::{Random, between, noise, posture};
use glam::DVec3;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use trocar_core::Pose;
use trocar_robot::chain::{ArmState, Drive, JointKind, JointLimits, Joints, SerialArm};
use trocar_testing::python_with;

const STATES: usize = 1000;

/// The Menagerie's FR3; prints why there is none.
fn menagerie() -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/franka_fr3/fr3.xml"));
    if !path.is_file() {
        println!("skipped: no {}", path.display());
        return None;
    }
    Some(path.to_owned())
}

fn run(python: &Path, model: &Path, names: [&str; 2], table: &str, mode: &[&str]) -> Vec<Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("table.txt");
    std::fs::write(&file, table).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/oracles/mujoco_arm.py");
    let mut command = Command::new(python);
    command.arg(script).arg(model).args(names).arg(mode[0]).arg(&file).args(&mode[1..]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|l| l.split_whitespace().map(|w| w.parse().unwrap()).collect()).collect()
}

fn push(table: &mut String, parts: &[&Joints]) {
    for v in parts.iter().flat_map(|p| p.iter()) {
        write!(table, "{v:e} ").unwrap();
    }
    table.push('\n');
}

/// The maximum relative difference of each quantity over random states.
fn compare(arm: &SerialArm, python: &Path, model: &Path, names: [&str; 2]) -> [f64; 6] {
    let n = arm.dof();
    let mut rng = Random(7);
    let states: Vec<_> = (0..STATES).map(|_| (posture(arm, &mut rng), noise(n, 2.5, &mut rng))).collect();
    let mut table = String::new();
    states.iter().for_each(|(q, qd)| push(&mut table, &[q, qd]));
    let answers = run(python, model, names, &table, &["states"]);
    assert_eq!(answers.len(), STATES);
    let mut worst = [0.0; 6];
    for ((q, qd), answer) in states.iter().zip(&answers) {
        let dynamics = arm.dynamics(q, qd);
        let (frames, flange) = (dynamics.frames, dynamics.frames.flange());
        let (mut positions, mut turns) = (Vec::new(), Vec::new());
        for i in 0..n {
            let link = frames.link(i);
            positions.extend(link.translation.to_array());
            turns.extend(glam::DMat3::from_quat(link.rotation).transpose().to_cols_array());
        }
        positions.extend(turns);
        positions.extend(flange.translation.to_array());
        let jacobian = frames.flange_jacobian();
        let by_row =
            |columns: &[DVec3]| (0..3).flat_map(|a| columns.iter().map(move |c| c[a]).collect::<Vec<_>>()).collect();
        let mass = (0..n).flat_map(|i| dynamics.mass_matrix.row(i).to_vec()).collect();
        let linear: Vec<f64> = by_row(jacobian.linear());
        let angular: Vec<f64> = by_row(jacobian.angular());
        let ours: [Vec<f64>; 6] =
            [positions, linear, angular, mass, dynamics.bias.to_vec(), arm.gravity_torque(q).to_vec()];
        let mut at = 0;
        for (worst, ours) in worst.iter_mut().zip(&ours) {
            let theirs = &answer[at..at + ours.len()];
            at += ours.len();
            let size = theirs.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            let off = ours.iter().zip(theirs).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
            *worst = f64::max(*worst, off / size);
        }
        assert_eq!(at, answer.len());
    }
    println!(
        "{}: frames {:.1e}, J {:.1e} {:.1e}, M {:.1e}, bias {:.1e}, gravity {:.1e}",
        arm.name(),
        worst[0],
        worst[1],
        worst[2],
        worst[3],
        worst[4],
        worst[5]
    );
    worst
}

/// Our arm as an MJCF file.
fn as_mjcf(arm: &SerialArm) -> String {
    let mut text = String::from("<mujoco><compiler angle=\"radian\"/><worldbody>\n");
    let pose = |p: Pose| {
        let (t, r) = (p.translation, p.rotation);
        format!("pos=\"{:e} {:e} {:e}\" quat=\"{:e} {:e} {:e} {:e}\"", t.x, t.y, t.z, r.w, r.x, r.y, r.z)
    };
    let body = |m: &trocar_robot::chain::MassProperties| {
        let (c, i) = (m.center, m.inertia);
        format!(
            "<inertial pos=\"{:e} {:e} {:e}\" mass=\"{:e}\" fullinertia=\"{:e} {:e} {:e} {:e} {:e} {:e}\"/>",
            c.x, c.y, c.z, m.mass, i.x_axis.x, i.y_axis.y, i.z_axis.z, i.y_axis.x, i.z_axis.x, i.z_axis.y
        )
    };
    for (i, s) in arm.segments().iter().enumerate() {
        let j = &s.joint;
        let kind = if j.kind == JointKind::Revolute { "hinge" } else { "slide" };
        let [low, high] = j.limits.position;
        let limits = if low.is_finite() { format!("range=\"{low:e} {high:e}\"") } else { String::new() };
        let effort = j.limits.effort;
        let drive =
            if effort.is_finite() { format!("actuatorfrcrange=\"{:e} {effort:e}\"", -effort) } else { String::new() };
        let own = if i == 0 {
            let p = arm.base();
            Pose { rotation: p.rotation * j.placement.rotation, translation: p.transform(j.placement.translation) }
        } else {
            j.placement
        };
        let (a, name) = (j.axis, &s.link);
        writeln!(
            text,
            "<body name=\"{name}\" {}>{}<joint type=\"{kind}\" axis=\"{:e} {:e} {:e}\" armature=\"{:e}\" damping=\"{:e}\" \
             frictionloss=\"{:e}\" {limits} {drive}/>",
            pose(own), body(&s.mass), a.x, a.y, a.z, j.armature, j.damping, j.friction
        )
        .unwrap();
    }
    write!(text, "<site name=\"flange\" {}/>", pose(arm.flange())).unwrap();
    if arm.payload().mass > 0.0 {
        write!(text, "<body name=\"payload\" {}>{}</body>", pose(arm.flange()), body(&arm.payload())).unwrap();
    }
    text + &"</body>\n".repeat(arm.dof()) + "</worldbody></mujoco>\n"
}

#[test]
fn the_arm_read_from_mjcf_equals_mujocos() {
    let (Some(model), Some(python)) = (menagerie(), python_with("mujoco", "MuJoCo")) else { return };
    let arm = SerialArm::from_mjcf(&model, "attachment_site").unwrap();
    assert_eq!(arm.dof(), 7);
    let worst = compare(&arm, &python, &model, ["fr3_link7", "attachment_site"]);
    assert!(worst.iter().all(|w| *w < 1e-9), "{worst:?}");
}

/// The built-in table has the manufacturer's unrounded inertias: it equals its own figures in
/// MuJoCo exactly, and the Menagerie's file up to rounding.
#[test]
fn the_built_in_fr3_equals_mujocos() {
    let Some(python) = python_with("mujoco", "MuJoCo") else { return };
    let payload = common::rod(0.5, 0.2);
    let base = Pose { rotation: glam::DQuat::from_rotation_y(0.3), translation: DVec3::new(-0.45, 0.1, 0.2) };
    let arm = SerialArm::franka_fr3().unwrap().with_base(base).unwrap().with_payload(payload).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for arm in [arm, common::skewed(7)] {
        let file = folder.path().join("arm.xml");
        std::fs::write(&file, as_mjcf(&arm)).unwrap();
        let worst = compare(&arm, &python, &file, [&arm.segments()[6].link, "flange"]);
        assert!(worst.iter().all(|w| *w < 1e-9), "{worst:?}");
        // Our reader reads the same as MuJoCo.
        let read = SerialArm::from_mjcf(&file, "flange").unwrap();
        let q = posture(&arm, &mut Random(1));
        let off = (read.frames(&q).flange().translation - arm.frames(&q).flange().translation).length();
        assert!(off < 1e-12, "{off}");
    }
    let Some(model) = menagerie() else { return };
    let arm = SerialArm::franka_fr3().unwrap();
    let worst = compare(&arm, &python, &model, ["fr3_link7", "attachment_site"]);
    assert!(worst.iter().all(|w| *w < 1e-4), "{worst:?}");
    let theirs = SerialArm::from_mjcf(&model, "attachment_site").unwrap();
    for (a, b) in arm.segments().iter().zip(theirs.segments()) {
        // The limits of this version of the file are the manufacturer's. MJCF has no speeds.
        assert_eq!(a.joint.limits.position, b.joint.limits.position);
        assert_eq!(a.joint.limits.effort, b.joint.limits.effort);
        let rest = |j: &trocar_robot::chain::Joint| [j.armature, j.damping, j.friction];
        assert_eq!(rest(&a.joint), rest(&b.joint));
    }
    assert!(arm.home().iter().zip(theirs.home().iter()).all(|(a, b)| (a - b).abs() < 2e-4), "theirs is rounded");
}

/// Maximum difference of joints over 2 s with the same torques (rad).
fn drift(arm: &SerialArm, python: &Path, model: &Path, step: f64, friction: &str) -> f64 {
    let n = arm.dof();
    let steps = (2.0 / step).round() as usize;
    let every = steps / 100;
    let mut rng = Random(3);
    let start = Joints::from_fn(n, |i| [0.2, -0.3, 0.1, -1.8, 0.3, 1.6, 0.2][i]);
    let qd = noise(n, 0.3, &mut rng);
    // Records the torques of a controller that swings the joints, then applies them to both.
    let phase: Vec<_> = (0..n).map(|_| (between(&mut rng, 0.5, 1.1), between(&mut rng, 0.0, 6.0))).collect();
    let mut table = String::new();
    push(&mut table, &[&start, &qd]);
    let mut state = ArmState { q: start, qd };
    let mut torques = Vec::new();
    for k in 0..steps {
        let t = k as f64 * step;
        let gravity = arm.gravity_torque(&state.q);
        let torque = Joints::from_fn(n, |i| {
            let gain = if i < 4 { 40.0 } else { 8.0 };
            let goal = start[i] + 0.4 * (std::f64::consts::TAU * phase[i].0 * t + phase[i].1).sin();
            gravity[i] + gain * (goal - state.q[i]) - 0.1 * gain * state.qd[i]
        });
        arm.step(&mut state, &Drive { torque, external: arm.zeros() }, &mut [], step, 1).unwrap();
        push(&mut table, &[&torque]);
        torques.push(torque);
    }
    let (step_text, every_text) = (format!("{step:e}"), every.to_string());
    let mode = ["trajectory", &step_text, friction, &every_text];
    let answers = run(python, model, ["fr3_link7", "attachment_site"], &table, &mode);
    let mut state = ArmState { q: start, qd };
    let (mut off, mut moved) = (0.0, 0.0);
    for k in 0..steps {
        let drive = Drive { torque: torques[k], external: arm.zeros() };
        let report = arm.step(&mut state, &drive, &mut [], step, 1).unwrap();
        assert!(report.torque_limited.is_empty() && report.at_position_limit.is_empty() && report.converged);
        assert!(report.at_velocity_limit.is_empty());
        if (k + 1) % every == 0 {
            for i in 0..n {
                off = f64::max(off, (state.q[i] - answers[(k + 1) / every - 1][i]).abs());
                moved = f64::max(moved, (state.q[i] - start[i]).abs());
            }
        }
    }
    assert!(moved > 0.3, "the drive must move it: {moved}");
    println!("driven 2 s at {step:.2e} s, friction {friction}: {off:.1e} rad after up to {moved:.2} rad");
    off
}

/// Both use semi-implicit Euler with implicit damping and the same step. Without friction they
/// agree to rounding at 480 Hz. MuJoCo's friction is a soft constraint, which creeps under a load;
/// at 4,800 Hz it is as hard as its step allows.
#[test]
fn a_driven_arm_moves_like_mujocos() {
    let (Some(model), Some(python)) = (menagerie(), python_with("mujoco", "MuJoCo")) else { return };
    let arm = SerialArm::from_mjcf(&model, "attachment_site").unwrap();
    let damping: Vec<_> = arm.segments().iter().map(|s| s.joint.damping).collect();
    let slippery =
        arm.clone().with_friction(&[0.0; 7], &damping).unwrap().with_limits(&[JointLimits::NONE; 7]).unwrap();
    let off = drift(&slippery, &python, &model, 1.0 / 480.0, "none");
    assert!(off < 1e-9, "{off}");
    let hard = drift(&arm, &python, &model, 1.0 / 4800.0, "hard");
    assert!(hard < 1e-4, "{hard}");
}
