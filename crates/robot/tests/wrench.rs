//! The load at the tool mount: identified within its covariance, and compensated.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::Random;
use glam::{DQuat, DVec3};
use trocar_core::Wrench;
use trocar_robot::instrument::Instrument;
use trocar_robot::wrench::*;

const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
const NOISE: SensorNoise = SensorNoise { force: 0.02, torque: 0.001 };

fn truth() -> LoadModel {
    let bias = Wrench { force: DVec3::new(1.2, -0.8, 2.0), torque: DVec3::new(0.05, -0.03, 0.02) };
    LoadModel::of(&Instrument::grasper(), bias)
}

fn noisy(random: &mut Random, w: Wrench) -> Wrench {
    w + Wrench { force: NOISE.force * random.vector(), torque: NOISE.torque * random.vector() }
}

fn weighed(random: &mut Random, tilt: f64) -> Vec<StaticReading> {
    let at = |o: DQuat, random: &mut Random| StaticReading {
        orientation: o,
        reading: noisy(random, truth().reading(o, GRAVITY)),
    };
    static_orientations(STATIC_POSES, tilt).unwrap().into_iter().map(|o| at(o, random)).collect()
}

#[test]
fn the_instrument_weighs_4_7_newtons() {
    let exact: Vec<_> = static_orientations(54, STATIC_TILT)
        .unwrap()
        .into_iter()
        .map(|orientation| StaticReading { orientation, reading: truth().reading(orientation, GRAVITY) })
        .collect();
    let found = identify(&exact, &NOISE, GRAVITY).unwrap();
    assert!((found.model.weight(GRAVITY) - 4.7).abs() < 1e-12 && found.chi_squared < 1e-15);
    assert!((found.model.centre() - truth().centre()).length() < 1e-13);
    assert!(found.condition < 10.0, "{}", found.condition);
    assert_eq!(found.degrees, 314);
}

#[test]
fn errors_of_estimates_match_their_covariance() {
    let runs = 400;
    let (mut distance, mut fit, mut weights) = (0.0, 0.0, 0.0);
    let mut said = 0.0;
    for seed in 0..runs {
        let mut random = Random(1000 + seed);
        let found = identify(&weighed(&mut random, STATIC_TILT), &NOISE, GRAVITY).unwrap();
        distance += found.distance_squared(&truth());
        fit += found.chi_squared / found.degrees as f64;
        weights += (found.model.mass - truth().mass).powi(2);
        said = found.deviations().mass;
    }
    let n = runs as f64;
    // Chi-squared of ten degrees: mean 10, standard deviation of the mean of n sqrt(20/n).
    assert!((distance / n - 10.0).abs() < 4.0 * (20.0 / n).sqrt(), "{}", distance / n);
    assert!((fit / n - 1.0).abs() < 4.0 * (2.0 / 314.0 / n).sqrt(), "{}", fit / n);
    assert!(((weights / n).sqrt() / said - 1.0).abs() < 0.15, "{} {said}", (weights / n).sqrt());
}

#[test]
fn the_rest_is_the_contact_force_within_its_uncertainty() {
    let (mut outside, mut count, mut squares) = (0, 0, 0.0);
    for seed in 0..200 {
        let mut random = Random(5000 + seed);
        let load = identify(&weighed(&mut random, STATIC_TILT), &NOISE, GRAVITY).unwrap();
        let mut compensator = Compensator::new(load, NOISE, GRAVITY).unwrap();
        // The bias drifts between identification and reset, as in strain gauges: the tare removes
        // it.
        let drifted = LoadModel { bias: Wrench { force: DVec3::splat(0.7), torque: DVec3::splat(0.02) }, ..truth() };
        let start = DQuat::from_rotation_x(std::f64::consts::PI - 0.23);
        let tare: Vec<_> = (0..30).map(|_| noisy(&mut random, drifted.reading(start, GRAVITY))).collect();
        compensator.tare(start, &tare).unwrap();
        let orientation = DQuat::from_rotation_y(0.3) * start;
        let force = DVec3::new(0.03, 0.0, 0.04);
        let touch = Wrench::at(orientation.inverse() * force, DVec3::Z * 0.428);
        let reading = noisy(&mut random, drifted.reading(orientation, GRAVITY) + touch);
        let left = compensator.force(orientation, reading, ForceKind::Contact).unwrap();
        assert_eq!(left.kind, ForceKind::Contact);
        let off = (left.wrench.force - force) / left.force_deviation();
        squares += off.length_squared();
        outside += off.to_array().iter().filter(|o| o.abs() > 1.96).count();
        count += 3;
    }
    let share = f64::from(outside as u32) / f64::from(count);
    assert!((0.02..0.09).contains(&share), "one in twenty outside two deviations: {share}");
    assert!((squares / f64::from(count) - 1.0).abs() < 0.25, "{}", squares / f64::from(count));
}

#[test]
fn the_uncertainty_grows_with_the_rotation_since_the_tare() {
    let mut random = Random(3);
    let load = identify(&weighed(&mut random, STATIC_TILT), &NOISE, GRAVITY).unwrap();
    let mut c = Compensator::new(load, NOISE, GRAVITY).unwrap();
    let start = DQuat::from_rotation_x(3.0);
    let reading = truth().reading(start, GRAVITY);
    c.tare(start, &[reading; 1000]).unwrap();
    let at = |o| c.force(o, truth().reading(o, GRAVITY), ForceKind::Constraint).unwrap();
    let still = at(start);
    assert!(still.wrench.force.length() < 1e-12 && still.kind == ForceKind::Constraint);
    assert!((still.force_deviation() / NOISE.force - DVec3::ONE).abs().max_element() < 1e-3);
    let turned = at(DQuat::from_rotation_x(2.0));
    assert!(turned.force_deviation().max_element() > 1.01 * NOISE.force);
    assert!(turned.wrench.force.length() < 0.05);
}

#[test]
fn too_similar_orientations_are_refused() {
    let read = |o: DQuat| StaticReading { orientation: o, reading: truth().reading(o, GRAVITY) };
    let refused = |poses: &[StaticReading], why: &str| {
        let e = identify(poses, &NOISE, GRAVITY).unwrap_err().to_string();
        assert!(e.contains(why), "{e}");
    };
    let good: Vec<_> = static_orientations(54, STATIC_TILT).unwrap().into_iter().map(read).collect();
    refused(&[], "too few");
    refused(&good[..2], "too few");
    refused(&[good[0]; 54], "too similar");
    // Rotations about the vertical do not change the effect of gravity.
    let yaw: Vec<_> = (0..54).map(|k| read(DQuat::from_rotation_z(0.1 * f64::from(k)))).collect();
    refused(&yaw, "too similar");
    let narrow = static_orientations(54, 1_f64.to_radians()).unwrap().into_iter().map(read).collect::<Vec<_>>();
    refused(&narrow, "too similar");
    let mut bad = good.clone();
    bad[7].reading.torque.y = f64::NAN;
    refused(&bad, "pose 7, reading");
    bad[7] = StaticReading { orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5), ..good[7] };
    refused(&bad, "pose 7, orientation");
    assert!(identify(&good, &SensorNoise { force: 0.0, ..NOISE }, GRAVITY).is_err());
    assert!(identify(&good, &NOISE, DVec3::ZERO).unwrap_err().to_string().contains("gravity"));
    assert!(static_orientations(2, 1.0).is_err() && static_orientations(54, f64::NAN).is_err());
    let load = identify(&good[..3], &NOISE, GRAVITY).unwrap();
    assert!((load.model.mass - truth().mass).abs() < 1e-9, "three poses are enough without noise");
    let mut c = Compensator::new(load, NOISE, GRAVITY).unwrap();
    assert!(c.tare(DQuat::IDENTITY, &[]).is_err());
    assert!(c.tare(DQuat::IDENTITY, &[Wrench { force: DVec3::NAN, ..Wrench::default() }]).is_err());
    assert!(
        c.force(DQuat::IDENTITY, Wrench { force: DVec3::INFINITY, ..Wrench::default() }, ForceKind::Contact).is_err()
    );
}
