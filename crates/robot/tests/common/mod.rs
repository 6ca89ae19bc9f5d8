//! Random numbers and states for the tests of arms.

#![allow(dead_code, clippy::unwrap_used, reason = "helper functions of tests")]

pub mod files;
pub mod random;

#[allow(unused_imports, reason = "each test file uses its own part")]
pub use random::Random;

use glam::{DMat3, DVec3};
use trocar_core::Pose;
use trocar_robot::chain::{Joint, JointKind, JointLimits, Joints, MassProperties, Segment, SerialArm};
use trocar_robot::instrument::{Coordinates, Instrument};
use trocar_robot::manipulator::{ControllerSettings, Manipulator};
use trocar_robot::port::Port;

/// A number in a range.
pub fn between(rng: &mut Random, low: f64, high: f64) -> f64 {
    rng.between(low, high)
}

/// A posture within the limits.
pub fn posture(arm: &SerialArm, rng: &mut Random) -> Joints {
    Joints::from_fn(arm.dof(), |i| {
        let [low, high] = arm.segments()[i].joint.limits.position;
        between(rng, low.max(-3.0), high.min(3.0))
    })
}

/// Numbers of both signs.
pub fn noise(n: usize, size: f64, rng: &mut Random) -> Joints {
    Joints::from_fn(n, |_| between(rng, -size, size))
}

/// A rod of a mass (kg) and half length (m) along its x.
pub fn rod(mass: f64, half: f64) -> MassProperties {
    let across = mass * half * half / 3.0;
    MassProperties {
        mass,
        center: DVec3::X * half,
        inertia: DMat3::from_diagonal(DVec3::new(0.01 * across, across, across)),
    }
}

/// Revolute and prismatic joints about skewed axes, without friction, limits and armature.
pub fn skewed(n: usize) -> SerialArm {
    let segment = |i: usize| {
        let slides = i % 3 == 2;
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4 + 0.3 * i as f64, -0.2, 0.7 * i as f64);
        Segment {
            link: format!("link{i}"),
            joint: Joint {
                name: format!("joint{i}"),
                kind: if slides { JointKind::Prismatic } else { JointKind::Revolute },
                placement: Pose { rotation: turn, translation: DVec3::new(0.2, 0.05 * i as f64, 0.1) },
                axis: DVec3::new(0.2, 1.0, 0.3 * i as f64),
                limits: JointLimits::NONE,
                armature: 0.0,
                damping: 0.0,
                friction: 0.0,
            },
            mass: rod(1.0 + 0.2 * i as f64, 0.15),
        }
    };
    SerialArm::new("skewed", (0..n).map(segment).collect(), Pose::IDENTITY).unwrap()
}

/// The FR3 without dissipation: no friction, damping or limits.
pub fn free_fr3() -> SerialArm {
    let arm = SerialArm::franka_fr3().unwrap();
    let nothing = vec![0.0; arm.dof()];
    arm.with_friction(&nothing, &nothing).unwrap().with_limits(&[JointLimits::NONE; 7]).unwrap()
}

/// An arm of the paper's cell: the left one with the grasper at 13.3 degrees, the right one with
/// the cutter at 18.3 degrees, in a sheet without thickness.
pub fn cell(side: usize, settings: ControllerSettings) -> Manipulator {
    let x = [-1.0, 1.0][side.min(1)];
    let base = Pose {
        rotation: glam::DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
        translation: DVec3::new(0.45 * x, 0.0, 0.0),
    };
    let arm = SerialArm::franka_fr3().unwrap().with_base(base).unwrap();
    let instrument = [Instrument::grasper(), Instrument::cutter()][side.min(1)].clone();
    let port = Port::new(DVec3::new(0.045 * x, 0.46, 0.16), -DVec3::Z, DVec3::X).unwrap();
    Manipulator::new(arm, instrument, port, settings, start(side)).unwrap()
}

/// Their start.
pub fn start(side: usize) -> Coordinates {
    let tilt = [13.3_f64, 18.3][side.min(1)].to_radians();
    Coordinates { pivots: [0.0, [1.0, -1.0][side.min(1)] * tilt], insertion: 0.1, roll: 0.0, jaw: 0.5 }
}

/// A tip on a circle of 15 mm across the port's normal, from rest to rest in 4 s.
pub fn tip_circle(m: &Manipulator, start: &Coordinates, t: f64) -> Pose {
    let s = (t / 4.0).clamp(0.0, 1.0);
    let a = std::f64::consts::TAU * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    let tip = m.port().tip(start);
    Pose { translation: tip.translation + 0.015 * DVec3::new(a.cos() - 1.0, a.sin(), 0.5 * a.sin()), ..tip }
}
