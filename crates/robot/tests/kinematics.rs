//! Poses from coordinates and back, and rejected parts of wanted poses.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::Random;
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_robot::instrument::{Coordinates, Instrument, Limits};
use trocar_robot::port::{Port, Twist};

fn port() -> Port {
    Port::new(DVec3::new(0.1, 0.46, 0.2), DVec3::new(0.1, 0.2, -1.0), DVec3::X).unwrap()
}

fn limits() -> Limits {
    port().limits(&Instrument::grasper(), 1e-4, 0.01).unwrap()
}

fn random(random: &mut Random, limits: &Limits) -> Coordinates {
    let (tilt, to) = (random.between(0.0, 0.999 * limits.tilt), random.between(0.0, std::f64::consts::TAU));
    let u = DVec3::new(tilt.sin() * to.cos(), tilt.sin() * to.sin(), tilt.cos());
    Coordinates {
        pivots: [(-u.y).atan2(u.z), u.x.asin()],
        insertion: random.between(limits.insertion[0], limits.insertion[1]),
        roll: random.between(limits.roll[0], limits.roll[1]),
        jaw: random.between(0.0, 1.0),
    }
}

fn off(a: &Coordinates, b: &Coordinates) -> f64 {
    a.to_action().iter().zip(b.to_action()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn angle(q: DQuat) -> f64 {
    2.0 * DVec3::new(q.x, q.y, q.z).length().atan2(q.w.abs())
}

#[test]
fn a_thousand_coordinates_survive_a_round_trip() {
    let (port, limits, mut random_numbers) = (port(), limits(), Random(1));
    let mut instrument = Instrument::grasper();
    // A general mount.
    instrument.mount.rotation = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(1.1);
    instrument.mount.translation = DVec3::new(0.03, -0.02, 0.05);
    for _ in 0..1000 {
        let c = random(&mut random_numbers, &limits);
        let flange = port.flange(&instrument, &c);
        let m = port.measure(&instrument, &flange, c.jaw).unwrap();
        assert!(off(&m.coordinates, &c) < 1e-12, "{:?} {c:?}", m.coordinates);
        assert!(m.deviation() < 1e-14 && (m.tilt - c.tilt()).abs() < 1e-14);
        assert!((m.tip.translation - port.tip(&c).translation).length() < 1e-14);
        let s = port.solve(&instrument, &limits, &m.tip, &c).unwrap();
        assert!(off(&s.coordinates, &c) < 1e-12 && !s.excess.any(), "{s:?}");
        assert!(s.rejected_rotation.length() < 1e-12 && s.rejected_translation.length() < 1e-14);
        assert!((s.flange.translation - flange.translation).length() < 1e-13);
        assert!(angle(s.flange.rotation * flange.rotation.inverse()) < 1e-13);
    }
}

#[test]
fn rejected_parts_are_reported() {
    let (port, limits, mut random_numbers) = (port(), limits(), Random(3));
    let instrument = Instrument::grasper();
    for _ in 0..1000 {
        let c = random(&mut random_numbers, &limits);
        let reached = port.tip(&c);
        // The port rejects a rotation across the shaft.
        let along = reached.rotation * DVec3::X;
        let across = random_numbers.vector().cross(along).normalize() * random_numbers.between(0.0, 3.1);
        let wanted = Pose { rotation: (DQuat::from_scaled_axis(across) * reached.rotation).normalize(), ..reached };
        let s = port.solve(&instrument, &limits, &wanted, &c).unwrap();
        assert!((s.rejected_rotation - across).length() < 1e-9, "{} {across}", s.rejected_rotation);
        assert!(off(&s.coordinates, &c) < 1e-9 && !s.excess.any());
    }
    for _ in 0..1000 {
        // Any pose: the reached and the rejected part add up to the wanted pose.
        let wanted =
            Pose { rotation: random_numbers.rotation(), translation: port.centre() + 0.3 * random_numbers.vector() };
        let near = random(&mut random_numbers, &limits);
        let s = port.solve(&instrument, &limits, &wanted, &near).unwrap();
        let back = DQuat::from_scaled_axis(s.rejected_rotation) * s.tip.rotation;
        assert!(angle(back * wanted.rotation.inverse()) < 1e-9);
        assert!((s.tip.translation + s.rejected_translation - wanted.translation).length() < 1e-12);
        assert!(s.coordinates.tilt() <= limits.tilt + 1e-12);
        let (clamped, _) = limits.clamp(&s.coordinates);
        assert!(off(&clamped, &s.coordinates) < 1e-12, "the answer is within the limits");
        let free = s.excess.tilt == 0.0 && s.excess.insertion == 0.0;
        assert_eq!(free, s.rejected_translation.length() < 1e-12);
    }
}

#[test]
fn out_of_reach_the_nearest_point_is_used_and_moves_smoothly() {
    let (port, limits) = (port(), limits());
    let instrument = Instrument::grasper();
    let near = Coordinates { insertion: 0.1, ..Coordinates::default() };
    let solve = |p: DVec3| {
        let wanted = Pose { rotation: port.pose.rotation, translation: port.pose.transform(p) };
        port.solve(&instrument, &limits, &wanted, &near).unwrap()
    };
    let mut random_numbers = Random(4);
    for _ in 0..200 {
        let p = 0.25 * random_numbers.vector();
        let s = solve(p);
        // No reachable point of a fine grid is nearer.
        for k in 0..4000 {
            let (a, b, c) = ((k % 40) as f64 / 39.0, f64::from(k / 40 % 10) / 9.0, f64::from(k / 400) / 9.0);
            let (tilt, to) = (limits.tilt * b, std::f64::consts::TAU * a);
            let l = limits.insertion[0] + c * (limits.insertion[1] - limits.insertion[0]);
            let q = l * DVec3::new(tilt.sin() * to.cos(), tilt.sin() * to.sin(), tilt.cos());
            assert!(s.rejected_translation.length() <= (q - p).length() + 1e-12, "{p} {q}");
        }
        // After 10 um the result has moved no farther, except for the rotation about the axis if
        // the wanted point is nearer to it.
        let next = solve(p + DVec3::new(1e-5, -0.5e-5, 0.5e-5));
        let across = p.truncate().length();
        let widest = 0.35 * 0.55;
        if p.z > -0.1 || across > 0.02 {
            let most = 1.3e-5 * (1.0 + widest / across.min(p.length()));
            assert!((next.tip.translation - s.tip.translation).length() < most, "{p}");
        }
    }
    // The binding limit and its excess.
    let s = solve(DVec3::new(0.0, 0.0, 0.5));
    assert_eq!(s.excess.binding().map(|b| b.0).collect::<Vec<_>>(), ["insertion"]);
    assert!((s.excess.insertion - (0.5 - limits.insertion[1])).abs() < 1e-12);
    let s = solve(DVec3::new(0.1, 0.0, 0.1));
    assert!((s.excess.tilt - (45_f64.to_radians() - limits.tilt)).abs() < 1e-12 && s.excess.insertion == 0.0);
}

#[test]
fn the_roll_does_not_jump_at_half_a_turn() {
    let port = port();
    let instrument = Instrument::grasper();
    let limits = Limits { roll: [-10.0, 10.0], ..limits() };
    let mut near = Coordinates { insertion: 0.1, pivots: [0.1, 0.2], ..Coordinates::default() };
    for k in 0..200 {
        let wanted = port.tip(&Coordinates { roll: 0.05 * f64::from(k), ..near });
        let s = port.solve(&instrument, &limits, &wanted, &near).unwrap();
        assert!((s.coordinates.roll - near.roll).abs() < 0.051, "{k}");
        near = s.coordinates;
    }
    assert!((near.roll - 9.95).abs() < 1e-9);
}

#[test]
fn a_shaft_beside_the_centre_is_measured() {
    let (port, limits) = (port(), limits());
    let (instrument, mut random_numbers) = (Instrument::cutter(), Random(5));
    for _ in 0..200 {
        let c = random(&mut random_numbers, &limits);
        let beside = glam::DVec2::new(random_numbers.between(-4e-3, 4e-3), random_numbers.between(-4e-3, 4e-3));
        let mut flange = port.flange(&instrument, &c);
        flange.translation += port.pose.rotation * beside.extend(0.0);
        let m = port.measure(&instrument, &flange, c.jaw).unwrap();
        assert!((m.offset - beside).length() < 1e-14 && off(&m.coordinates, &c) < 1e-12);
        // The deviation is in the port's plane, not the minimum distance to the axis.
        assert!((m.deviation() - beside.length()).abs() < 1e-14);
    }
}

#[test]
fn rates_are_the_derivatives_of_measured_coordinates() {
    let (port, limits) = (port(), limits());
    let mut random_numbers = Random(6);
    let mut instrument = Instrument::grasper();
    instrument.mount.translation = DVec3::new(0.03, -0.02, 0.05);
    for _ in 0..200 {
        let c = Coordinates { roll: random_numbers.between(-2.0, 2.0), ..random(&mut random_numbers, &limits) };
        let mut flange = port.flange(&instrument, &c);
        flange.translation += 1e-3 * random_numbers.vector();
        let motion = Twist { linear: random_numbers.vector(), angular: random_numbers.vector() };
        let at = |t: f64| {
            let rotation = (DQuat::from_scaled_axis(t * motion.angular) * flange.rotation).normalize();
            let moved = Pose { rotation, translation: flange.translation + t * motion.linear };
            port.measure(&instrument, &moved, 0.0).unwrap().coordinates.to_action()
        };
        let (h, rates) = (1e-5, port.rates(&instrument, &flange, &motion).unwrap());
        let (a, b) = (at(-h), at(h));
        for k in 0..4 {
            assert!(((b[k] - a[k]) / (2.0 * h) - rates[k]).abs() < 1e-7 * (1.0 + rates[k].abs()), "{k} {rates:?}");
        }
    }
    let flange = port.flange(&instrument, &Coordinates { insertion: 0.1, ..Coordinates::default() });
    assert!(port.rates(&instrument, &flange, &Twist { linear: DVec3::NAN, ..Twist::default() }).is_err());
}

#[test]
fn bad_input_gives_errors() {
    let (port, limits, instrument) = (port(), limits(), Instrument::grasper());
    let near = Coordinates { insertion: 0.1, ..Coordinates::default() };
    let pose = port.tip(&near);
    let nan = Pose { translation: DVec3::NAN, ..pose };
    let long = Pose { rotation: pose.rotation * 2.0, ..pose };
    for wanted in [nan, long] {
        let e = port.solve(&instrument, &limits, &wanted, &near).unwrap_err().to_string();
        assert!(e.contains("wanted tip"), "{e}");
    }
    let lost = Coordinates { roll: f64::NAN, ..near };
    assert!(port.solve(&instrument, &limits, &pose, &lost).is_err());
    let empty = Limits { insertion: [0.2, 0.1], ..limits };
    assert!(port.solve(&instrument, &empty, &pose, &near).unwrap_err().to_string().contains("insertion"));
    // Pointing out of the body, and in the sheet's plane.
    for rotation in [DQuat::from_rotation_x(3.0), DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)] {
        let flange = Pose { rotation: port.pose.rotation * rotation, translation: port.centre() };
        assert!(port.measure(&instrument, &flange, 0.0).unwrap_err().to_string().contains("into the body"));
    }
    assert!(port.measure(&instrument, &nan, 0.0).is_err());
    // A wanted point at the centre has a solution.
    let at_centre = Pose { translation: port.centre(), ..pose };
    assert!(port.solve(&instrument, &limits, &at_centre, &near).unwrap().excess.insertion < 0.0);
}
