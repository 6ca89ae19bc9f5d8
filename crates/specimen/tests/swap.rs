//! An organ of one specimen in the place of the same organ of another.
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::{DQuat, DVec3};
use trocar_specimen::{Organ, Specimen};
use trocar_testing::tube::{ONE_END, two_tubes};

const TUBE: &str = "tube";

fn changed(mut organ: Organ, name: &str, change: impl Fn(DVec3) -> DVec3) -> Organ {
    name.clone_into(&mut organ.name);
    for p in organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices).chain([&mut organ.base]) {
        *p = change(*p);
    }
    organ
}

/// Two tubes, the first of them changed.
fn tubes(change: impl Fn(DVec3) -> DVec3) -> Specimen {
    let mut specimen = two_tubes(ONE_END, 4e-3);
    specimen.organs[0] = changed(specimen.organs[0].clone(), TUBE, change);
    specimen
}

/// The tube `scale` times as large as the host's.
fn larger(scale: f64) -> Specimen {
    tubes(|p| scale * p)
}

/// Two tubes, and a third one `scale` times as large, with its middle at `at` (m).
fn host(scale: f64, at: DVec3) -> Specimen {
    let mut specimen = tubes(|p| p);
    specimen.organs.push(changed(specimen.organs[0].clone(), "third", |p| scale * p + at));
    specimen
}

fn middle(organ: &Organ) -> DVec3 {
    organ.body.vertices.iter().sum::<DVec3>() / organ.body.vertices.len() as f64
}

#[test]
fn an_organ_that_lies_elsewhere_comes_to_its_base_and_direction() {
    let (host, turn) = (tubes(|p| p), DQuat::from_rotation_z(2.0));
    let other = tubes(|p| turn * p + DVec3::new(0.03, -0.2, 0.05));
    let made = host.with_organ_of(&other, TUBE).unwrap();
    let far = made.organs[0].body.vertices.iter().zip(&host.organs[0].body.vertices).map(|(a, b)| a.distance(*b));
    assert!(far.fold(0.0, f64::max) < 1e-9, "the same tube is where it was");
    assert!(made.organs[0].base.distance(host.organs[0].base) < 1e-9);
    assert_eq!(made.organs[1].body.vertices, host.organs[1].body.vertices);
    // Another vertical.
    let mut tilted = tubes(|p| DQuat::from_rotation_x(0.5) * p);
    tilted.up = DQuat::from_rotation_x(0.5) * tilted.up;
    let made = host.with_organ_of(&tilted, TUBE).unwrap();
    assert!(middle(&made.organs[0]).distance(middle(&host.organs[0])) < 1e-9);
}

#[test]
fn an_organ_that_would_lie_in_another_is_turned_or_refused() {
    let beside = host(0.3, DVec3::new(0.02, 0.0075, 0.0));
    let made = beside.with_organ_of(&larger(2.0), TUBE).unwrap();
    let ahead = middle(&made.organs[0]) - DVec3::new(-0.03, 0.0, 0.0);
    let turned = ahead.y.atan2(ahead.x).to_degrees();
    assert!((turned + 5.0).abs() < 0.5, "away from the third tube, as little as is enough: {turned} degrees");
    // Where nothing is in the way, it is not turned.
    let made = tubes(|p| p).with_organ_of(&larger(2.0), TUBE).unwrap();
    assert!(middle(&made.organs[0]).y.abs() < 1e-4);
    // Above the base.
    let closed = host(1.0, DVec3::new(-0.03, 0.0, -0.012));
    let said = closed.with_organ_of(&larger(3.0), TUBE).err().unwrap().to_string();
    assert!(said.starts_with("organ 'tube' would lie ") && said.contains("deeper in 'third'"), "{said}");
    assert!(closed.with_organ_of(&larger(1.0), TUBE).is_ok());
}

#[test]
fn a_missing_organ_is_named_with_those_that_are_there() {
    let said = tubes(|p| p).with_organ_of(&tubes(|p| p), "liver").err().unwrap().to_string();
    assert_eq!(said, "organ 'liver' is no organ of tube; it has tube, low");
}
