//! A shaft in its hole: compared with sampled points and closed forms, and in motion.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::Random;
use glam::{DVec2, DVec3};
use trocar_robot::port::{Port, RimState, Shaft, Twist};

const RADIUS: f64 = 2.5e-3;

fn port() -> Port {
    Port::new(DVec3::ZERO, DVec3::Z, DVec3::X).unwrap()
}

/// A shaft tilted towards the angle `to`, whose axis crosses z = 0 at `at`.
fn shaft(tilt: f64, to: f64, at: DVec2) -> Shaft {
    let direction = DVec3::new(tilt.sin() * to.cos(), tilt.sin() * to.sin(), tilt.cos());
    Shaft { base: at.extend(0.0) - 0.2 * direction, direction, radius: RADIUS, length: 0.33 }
}

/// Distance of a point from the axis, minus the radius.
fn gap(s: &Shaft, q: DVec3) -> f64 {
    (q - s.base).cross(s.direction).length() - s.radius
}

fn rim(port: &Port, z: f64, a: f64) -> DVec3 {
    (0.5 * port.hole_diameter * DVec2::from_angle(a)).extend(z)
}

#[test]
fn no_sampled_point_of_the_rim_is_nearer_and_every_contact_is_on_it() {
    let mut random = Random(11);
    const SAMPLES: usize = 3600;
    let mut doubles = 0;
    for case in 0..600 {
        let port = Port { thickness: if case % 2 == 0 { 0.0 } else { random.between(1e-4, 3e-3) }, ..port() };
        let offset = DVec2::from_angle(random.between(0.0, 6.3)) * random.between(0.0, 1.5e-3);
        let s = shaft(random.between(0.0, 0.75), random.between(0.0, 6.3), offset);
        let found: Vec<_> = port.nearest(&s).into_iter().flatten().collect();
        let edges: &[f64] = if port.thickness > 0.0 { &[-0.5, 0.5] } else { &[0.0] };
        let mut minima = 0;
        for edge in edges {
            let z = edge * port.thickness;
            let gaps: Vec<f64> = (0..SAMPLES)
                .map(|k| gap(&s, rim(&port, z, std::f64::consts::TAU * k as f64 / SAMPLES as f64)))
                .collect();
            let here: Vec<_> = found.iter().filter(|p| (p.point.z - z).abs() < 1e-12).collect();
            let least = here.iter().map(|p| p.gap).fold(f64::INFINITY, f64::min);
            let sampled = gaps.iter().copied().fold(f64::INFINITY, f64::min);
            // Between samples the rim is nearer by at most an eighth of the squared spacing times
            // the curvature.
            assert!(least <= sampled + 1e-15 && least > sampled - 5e-9, "{least} {sampled}");
            minima += (0..SAMPLES)
                .filter(|k| gaps[*k] < gaps[(k + 1) % SAMPLES] && gaps[*k] <= gaps[(k + SAMPLES - 1) % SAMPLES])
                .count();
            for p in here {
                assert!((gap(&s, p.point) - p.gap).abs() < 1e-15, "the gap is that of the point");
                assert!((p.point.truncate().length() - 3e-3).abs() < 1e-15);
                assert!(p.normal.dot(s.direction).abs() < 1e-12 && (p.normal.length() - 1.0).abs() < 1e-12);
                let to_axis = s.base - p.point - (s.base - p.point).dot(s.direction) * s.direction;
                assert!((to_axis.normalize() - p.normal).length() < 1e-6, "from the rim to the axis");
                let beside = [-1e-4, 1e-4].map(|d| gap(&s, rim(&port, p.point.z, p.angle + d)));
                assert!(beside.iter().all(|g| *g > p.gap - 1e-15), "a minimum along the rim");
            }
        }
        assert_eq!(found.len(), minima, "every minimum is found: {s:?}");
        doubles += usize::from(minima > edges.len());
    }
    assert!(doubles > 50, "the cases cover shafts between two sides: {doubles}");
}

/// Distance of the axis from the centre along `to` at first contact.
fn room(port: &Port, tilt: f64, to: f64) -> f64 {
    let fits =
        |d: f64| port.nearest(&shaft(tilt, 0.0, d * DVec2::from_angle(to))).iter().flatten().all(|p| p.gap >= 0.0);
    let (mut low, mut high) = (0.0, 2e-3);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

#[test]
fn the_distance_to_contact_is_the_papers_clearance() {
    for thickness in [0.0, 1e-3] {
        let port = Port { thickness, ..port() };
        for degrees in [0.0, 5.0, 13.3, 18.3, 24.0, 30.0, 33.0_f64] {
            let tilt = degrees.to_radians();
            let clearance = port.clearance(RADIUS, tilt);
            for to in [0.0, std::f64::consts::PI] {
                assert!((room(&port, tilt, to) - clearance.max(0.0)).abs() < 1e-12, "{thickness} {degrees}");
            }
        }
    }
    // Across the tilt: (D - d)/2 until the shaft's section has a smaller curvature than the hole.
    for degrees in [0.0, 13.3, 18.3, 24.0, 27.0, 30.0, 33.0_f64] {
        let (across, tilt) = (room(&port(), degrees.to_radians(), std::f64::consts::FRAC_PI_2), degrees.to_radians());
        assert!((across - port().clearance_across(RADIUS, tilt)).abs() < 1e-10, "{degrees} {across}");
        assert_eq!((across - 0.5e-3).abs() < 1e-10, degrees < 24.09);
    }
}

#[test]
fn an_ellipse_of_sampled_points_agrees() {
    // The inverse check: the shaft's elliptic section in the sheet's plane is inside the hole
    // exactly when there is no contact.
    let (port, mut random) = (port(), Random(12));
    let mut inside = 0;
    for _ in 0..2000 {
        let tilt = random.between(0.0, 0.58);
        let offset = DVec2::new(random.between(-0.6e-3, 0.6e-3), random.between(-0.6e-3, 0.6e-3));
        let s = shaft(tilt, 0.0, offset);
        let farthest = (0..2000)
            .map(|k| DVec2::from_angle(std::f64::consts::TAU * f64::from(k) / 2000.0))
            .map(|e| (offset + RADIUS * DVec2::new(e.x / tilt.cos(), e.y)).length())
            .fold(0.0, f64::max);
        let fits = port.nearest(&s).iter().flatten().all(|p| p.gap >= 0.0);
        if (farthest - 3e-3).abs() > 1e-7 {
            assert_eq!(fits, farthest < 3e-3, "{tilt} {offset}");
        }
        inside += usize::from(fits);
    }
    assert!((200..1800).contains(&inside), "{inside}");
}

#[test]
fn forces_are_the_gradient_of_the_springs_energy() {
    let port = Port { damping: 0.0, friction: 0.0, thickness: 1e-3, ..port() };
    let energy = |s: &Shaft| {
        let pressed = port.contacts(s, &Twist::default(), &RimState::default());
        pressed.touching().map(|c| 0.5 * port.stiffness * c.at.gap * c.at.gap).sum::<f64>()
    };
    let mut random = Random(13);
    for _ in 0..200 {
        let offset = DVec2::from_angle(random.between(0.0, 6.3)) * random.between(0.3e-3, 0.8e-3);
        let s = shaft(random.between(0.05, 0.4), random.between(0.0, 6.3), offset);
        let (force, torque) = port.contacts(&s, &Twist::default(), &RimState::default()).on_shaft(s.base);
        let h = 1e-7;
        for axis in DVec3::AXES {
            let moved = |by: f64| Shaft { base: s.base + by * axis, ..s };
            let slope = -(energy(&moved(h)) - energy(&moved(-h))) / (2.0 * h);
            assert!((slope - force.dot(axis)).abs() < 1e-4 * (1.0 + force.length()), "{slope} {force}");
            let turned = |by: f64| Shaft { direction: glam::DQuat::from_axis_angle(axis, by) * s.direction, ..s };
            let slope = -(energy(&turned(h)) - energy(&turned(-h))) / (2.0 * h);
            assert!((slope - torque.dot(axis)).abs() < 1e-4 * (1.0 + torque.length()), "{slope} {torque}");
        }
    }
}

#[test]
fn undamped_contact_gains_no_energy() {
    let port = Port { damping: 0.0, friction: 0.0, ..port() };
    let (mass, h) = (0.48, 5e-5);
    for (tilt, start) in [(0.0, 0.02), (0.232, 0.05), (0.319, 0.03)] {
        let (mut at, mut speed) = (DVec2::ZERO, start * DVec2::new(0.8, 0.6));
        let force = |at: DVec2| {
            let contacts = port.contacts(&shaft(tilt, 0.3, at), &Twist::default(), &RimState::default());
            let stored: f64 = contacts.touching().map(|c| 0.5 * port.stiffness * c.at.gap * c.at.gap).sum();
            (contacts.on_shaft(DVec3::ZERO).0.truncate(), stored)
        };
        let first = 0.5 * mass * speed.length_squared();
        let (mut f, mut bounces, mut peak) = (force(at).0, 0, first);
        for _ in 0..200_000 {
            // Velocity Verlet.
            speed += 0.5 * h / mass * f;
            at += h * speed;
            let (next, stored) = force(at);
            bounces += usize::from(f == DVec2::ZERO && next != DVec2::ZERO);
            f = next;
            speed += 0.5 * h / mass * f;
            peak = peak.max(0.5 * mass * speed.length_squared() + stored);
        }
        assert!(bounces > 50, "{bounces}");
        assert!(peak < 1.02 * first, "{tilt}: {peak} {first}");
    }
}

/// A shaft of 0.48 kg leans on the rim with 2 N, comes to rest for a second and is then pulled
/// along itself by `pull(t)` (N). Returns its displacement since then (m), at every millisecond of
/// `seconds`.
fn pulled(port: &Port, seconds: usize, pull: impl Fn(f64) -> f64) -> Vec<f64> {
    let (mass, h) = (0.48, 1e-4);
    let (mut s, mut motion, mut state) =
        (shaft(0.232, 0.7, DVec2::new(4e-4, 1e-4)), Twist::default(), RimState::default());
    let mut first = s.base;
    let lean = s.direction.any_orthonormal_vector();
    let mut places = Vec::new();
    for step in 0..(seconds + 1) * 10_000 {
        let t = step as f64 * h - 1.0;
        let load = 2.0 * lean + if t < 0.0 { 0.0 } else { pull(t) } * s.direction;
        first = if t < 0.0 { s.base } else { first };
        let (force, _) = port.contacts(&s, &motion, &state).on_shaft(s.base);
        motion.linear += h / mass * (force + load);
        s.base += h * motion.linear;
        port.advance(&s, &mut state);
        if t >= 0.0 && step % 10 == 0 {
            places.push((s.base - first).dot(s.direction));
        }
    }
    places
}

#[test]
fn friction_holds_for_a_minute_without_creep_and_slides_above_its_limit() {
    let port = port();
    // The limit is 0.2 x 2 N.
    let places = pulled(&port, 60, |_| 0.36);
    let (early, late) = (places[2_000], *places.last().unwrap());
    assert!((late - early).abs() < 1e-13, "crept by {} m in 58 s", late - early);
    assert!(late.abs() < 1e-4, "held: {late}");
    let places = pulled(&port, 1, |_| 0.44);
    assert!(*places.last().unwrap() > 0.01, "slides: {}", places.last().unwrap());
}

#[test]
fn friction_shaken_below_its_limit_returns() {
    let places = pulled(&port(), 11, |t| if t < 10.0 { 0.25 * (6.0 * t).sin() } else { 0.0 });
    assert!((places.last().unwrap() - places[10_900]).abs() < 1e-8);
    let amplitude = places[3_000..9_000].iter().fold(0.0_f64, |m, p| m.max(p.abs()));
    assert!(places.last().unwrap().abs() < 0.2 * amplitude, "{amplitude} {}", places.last().unwrap());
}

#[test]
fn rows_are_the_derivatives_of_forces() {
    let port = port();
    let s = shaft(0.2, 0.3, DVec2::new(6e-4, 0.0));
    let moving = Twist { linear: DVec3::new(0.01, 0.0, 0.0), angular: DVec3::ZERO };
    let (rest, moved) = (Twist::default(), RimState::default());
    let before = *port.contacts(&s, &rest, &moved).touching().next().unwrap();
    assert!((before.normal.force + port.stiffness * before.at.gap).abs() < 1e-12 && before.friction.force == 0.0);
    let faster = *port.contacts(&s, &moving, &moved).touching().next().unwrap();
    let change = -before.normal.damping * moving.linear.dot(before.normal.direction);
    assert!((faster.normal.force - before.normal.force - change).abs() < 1e-12);
    let mut state = RimState::default();
    port.advance(&s, &mut state);
    let h = 1e-6;
    let deeper = Shaft { base: s.base - h * before.normal.direction, ..s };
    let after = *port.contacts(&deeper, &rest, &state).touching().next().unwrap();
    assert!((after.normal.force - before.normal.force - h * before.normal.stiffness).abs() < 1e-6);
    let along = Shaft { base: s.base + h * s.direction, ..s };
    let after = *port.contacts(&along, &rest, &state).touching().next().unwrap();
    assert!((after.friction.force + h * before.friction.stiffness).abs() < 1e-9, "{:?}", after.friction);
}

#[test]
fn shafts_outside_the_hole_have_no_contact() {
    let port = port();
    let none = |s: Shaft| port.nearest(&s).iter().flatten().count() == 0;
    let s = shaft(0.1, 0.0, DVec2::ZERO);
    assert!(none(Shaft { base: s.base - s.direction, ..s }), "drawn out");
    assert!(none(Shaft { direction: DVec3::X, ..s }), "lies in the sheet");
    assert!(none(Shaft { base: DVec3::NAN, ..s }) && none(Shaft { direction: DVec3::NAN, ..s }));
    assert!(!none(s));
    // A shaft that was forced through the rim is pushed back.
    let through = port.contacts(&shaft(0.1, 0.0, DVec2::new(4e-3, 0.0)), &Twist::default(), &RimState::default());
    assert!(through.on_shaft(DVec3::ZERO).0.x < 0.0);
}
