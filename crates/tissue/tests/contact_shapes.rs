//! Distances of convex shapes against parry3d, which has them of its own, and their gradients
//! against finite differences.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::{DQuat, DVec3};
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{Ball, Capsule, ConvexPolyhedron, Cuboid, TriMesh, TriMeshFlags};
use parry3d_f64::transformation::convex_hull;
use trocar_testing::blocks::noise;
use trocar_tissue::{Collider, Hull, ModelBuilder, Shape};

const POINTS: u64 = 4000;

fn random(seed: u64) -> DVec3 {
    DVec3::new(noise(3 * seed), noise(3 * seed + 1), noise(3 * seed + 2)) * 2.0 - 1.0
}

fn rotation(seed: u64) -> DQuat {
    let axis = random(seed).try_normalize().unwrap();
    DQuat::from_axis_angle(axis, 6.0 * noise(seed + 7))
}

fn to_parry(p: DVec3) -> Vector {
    Vector::new(p.x, p.y, p.z)
}

/// Points of many kinds: random ones, rounded ones that lie in one plane by the dozen, and slivers.
fn clouds() -> Vec<(&'static str, Vec<DVec3>)> {
    let cube = |half: DVec3| -> Vec<DVec3> {
        (0..8).map(|c| half * DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64)).collect()
    };
    let grid = (0..27).map(|c| 2e-3 * DVec3::new((c % 3) as f64, (c / 3 % 3) as f64, (c / 9) as f64)).collect();
    let prism = (0..24).map(|k| {
        let (sin, cos) = (std::f64::consts::TAU * (k / 2) as f64 / 12.0).sin_cos();
        DVec3::new(3e-3 * cos, 3e-3 * sin, 20e-3 * (k % 2) as f64)
    });
    let mut clouds = vec![
        ("tetrahedron", vec![DVec3::ZERO, 1e-2 * DVec3::X, 1e-2 * DVec3::Y, 1e-2 * DVec3::Z]),
        ("cube", cube(DVec3::splat(5e-3))),
        ("blade", cube(DVec3::new(30e-3, 4e-3, 0.5e-3))),
        ("grid", grid),
        ("prism", prism.collect()),
    ];
    for seed in 0..12 {
        let turn = rotation(seed);
        let squash = DVec3::new(1.0, 0.1 + noise(900 + seed), 0.02 + noise(950 + seed));
        let count = 4 + 5 * seed;
        let cloud = (0..count).map(|k| 1e-2 * (turn * (random(1000 * seed + k) * squash)));
        clouds.push(("random", cloud.collect()));
        // On a lattice, so that many are in one plane or on one line.
        let cloud = (0..count + 20).map(|k| 1e-2 * (turn * (random(70_000 + 1000 * seed + k) * 2.0).round()));
        clouds.push(("lattice", cloud.collect()));
    }
    clouds
}

fn hulls() -> Vec<(&'static str, Vec<DVec3>, Hull)> {
    clouds().into_iter().map(|(name, cloud)| (name, cloud.clone(), Hull::of(&cloud).unwrap())).collect()
}

/// Points in and around a shape, some very near its surface.
fn around(shape: &Shape, seed: u64) -> impl Iterator<Item = DVec3> {
    let (centre, radius) = shape.bounds(0.0);
    let surface = shape.surface().vertices;
    (0..POINTS).map(move |k| {
        let p = random(seed + k);
        match k % 4 {
            0 | 1 => centre + 1.5 * radius * p,
            2 => centre + 0.5 * radius * p,
            _ => surface[k as usize % surface.len()] + 1e-3 * radius * p,
        }
    })
}

#[test]
fn hulls_are_closed_hold_their_points_and_have_parrys_volume() {
    for (name, cloud, hull) in hulls() {
        let surface = hull.surface();
        assert!(surface.is_watertight(), "{name}");
        let (corners, triangles) = convex_hull(&cloud.iter().map(|p| to_parry(*p)).collect::<Vec<_>>());
        let v = |i: u32| DVec3::from_array(corners[i as usize].into()) - cloud[0];
        let volume: f64 = triangles.iter().map(|t| v(t[0]).dot(v(t[1]).cross(v(t[2]))) / 6.0).sum();
        assert!((surface.volume() - volume).abs() < 1e-9 * volume, "{name}: {} and {volume}", surface.volume());
        for p in cloud {
            let distance = hull.nearest(p).distance;
            assert!(distance < 1e-9, "{name}: a point of it is {distance} m outside");
        }
    }
}

#[test]
fn hulls_are_as_far_as_parry_says() {
    for (at, (name, cloud, hull)) in hulls().into_iter().enumerate() {
        let (corners, triangles) = convex_hull(&cloud.iter().map(|p| to_parry(*p)).collect::<Vec<_>>());
        let mesh = TriMesh::with_flags(corners, triangles, TriMeshFlags::ORIENTED).unwrap();
        let shape = Shape::Hull(hull);
        for p in around(&shape, 100_000 * at as u64) {
            let near = shape.nearest(p);
            let theirs = mesh.project_local_point(to_parry(p), false);
            let off = p - DVec3::from_array(theirs.point.into());
            assert!((near.distance.abs() - off.length()).abs() < 1e-12, "{name} at {p}: {near:?}, parry {off}");
            if off.length() > 1e-9 {
                assert_eq!(theirs.is_inside, near.distance < 0.0, "{name} at {p}: {near:?}");
            }
            // Inside, several faces may be equally near.
            if near.distance > 1e-9 {
                assert!((near.normal - off / off.length()).length() < 1e-6, "{name} at {p}: {near:?}, parry {off}");
            }
        }
    }
}

/// Signed distance of a point.
type Distance = Box<dyn Fn(DVec3) -> f64>;

#[test]
fn round_shapes_and_boxes_are_as_far_as_parry_says() {
    for seed in 0..20 {
        let (centre, turn) = (0.02 * random(seed), rotation(30 + seed));
        let half = 1e-2 * (random(60 + seed).abs() + 0.01);
        let ends = [centre, centre + 0.03 * random(90 + seed)];
        let radius = half.x;
        let capsule = Capsule::new(to_parry(ends[0]), to_parry(ends[1]), radius);
        let cases: [(Shape, Distance); 3] = [
            (
                Shape::Sphere { centre, radius },
                Box::new(move |p| Ball::new(radius).distance_to_local_point(to_parry(p - centre), false)),
            ),
            (Shape::Capsule { ends, radius }, Box::new(move |p| capsule.distance_to_local_point(to_parry(p), false))),
            (
                Shape::Box { centre, rotation: turn, half },
                Box::new(move |p| {
                    let local = turn.inverse() * (p - centre);
                    Cuboid::new(to_parry(half)).distance_to_local_point(to_parry(local), false)
                }),
            ),
        ];
        for (shape, theirs) in cases {
            for p in around(&shape, 5000 * seed) {
                let (near, theirs) = (shape.nearest(p), theirs(p));
                assert!((near.distance - theirs).abs() < 1e-14, "{shape:?} at {p}: {near:?}, parry {theirs}");
            }
        }
    }
}

#[test]
fn a_box_is_the_hull_of_its_corners() {
    for seed in 0..20 {
        let shape = Shape::Box {
            centre: 0.01 * random(seed),
            rotation: rotation(200 + seed),
            half: 1e-2 * (random(300 + seed).abs() + 0.05),
        };
        let hull = Shape::Hull(Hull::of(&shape.surface().vertices).unwrap());
        for p in around(&shape, 4000 * seed) {
            let (a, b) = (shape.nearest(p), hull.nearest(p));
            assert!((a.distance - b.distance).abs() < 1e-14, "{a:?} {b:?}");
            assert!(a.distance < 1e-9 || (a.normal - b.normal).length() < 1e-5, "{a:?} {b:?}");
        }
    }
}

/// Every kind of shape, of the size of an instrument's parts.
fn shapes() -> Vec<Shape> {
    let mut shapes: Vec<Shape> = hulls().into_iter().map(|(_, _, hull)| hull.into()).collect();
    shapes.push(Shape::Sphere { centre: DVec3::new(1e-2, 0.0, 2e-2), radius: 4e-3 });
    shapes.push(Shape::Capsule { ends: [DVec3::ZERO, DVec3::new(0.0, 2e-2, 1e-2)], radius: 2.5e-3 });
    shapes.push(Shape::Capsule { ends: [DVec3::Z; 2], radius: 2.5e-3 });
    shapes.push(Shape::Box { centre: DVec3::Z, rotation: rotation(5), half: DVec3::new(1e-2, 2e-3, 1e-3) });
    shapes
}

#[test]
fn the_normal_is_the_gradient_of_the_distance() {
    const STEP: f64 = 1e-8;
    for (at, shape) in shapes().iter().enumerate() {
        let mut smooth = 0;
        for p in around(shape, 31_000 * at as u64) {
            let near = shape.nearest(p);
            assert!((near.normal.length() - 1.0).abs() < 1e-12);
            let distance = |d: DVec3| shape.nearest(p + d).distance;
            let along = |axis: DVec3| (distance(STEP * axis) - distance(-STEP * axis)) / (2.0 * STEP);
            let gradient = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
            // Where two faces are equally near, inside, there is none. It shows as a bend.
            let bend = |axis: DVec3| distance(STEP * axis) + distance(-STEP * axis) - 2.0 * near.distance;
            let bent = [DVec3::X, DVec3::Y, DVec3::Z].iter().any(|axis| bend(*axis).abs() > 1e-4 * STEP);
            if !bent {
                smooth += 1;
                assert!((gradient - near.normal).length() < 2e-4, "{shape:?} at {p}: {near:?}, differences {gradient}");
            }
        }
        assert!(smooth > POINTS * 8 / 10, "{shape:?}: {smooth} smooth points of {POINTS}");
    }
}

#[test]
fn points_on_the_surface_and_in_the_middle_have_a_normal() {
    for shape in shapes() {
        let (centre, _) = shape.bounds(0.0);
        let mesh = shape.surface();
        let middles = (0..mesh.triangles.len()).map(|t| mesh.corners(t).iter().sum::<DVec3>() / 3.0);
        let sides = (0..mesh.triangles.len()).map(|t| 0.5 * (mesh.corners(t)[0] + mesh.corners(t)[1]));
        let points = [centre].into_iter().chain(mesh.vertices.iter().copied()).chain(middles).chain(sides);
        for p in points {
            for p in [p, p + 1e-17, p - DVec3::X * 1e-18] {
                let near = shape.nearest(p);
                assert!((near.normal.length() - 1.0).abs() < 1e-12 && near.distance.is_finite(), "{shape:?}: {near:?}");
            }
        }
        if let Shape::Hull(_) | Shape::Box { .. } = shape {
            mesh.vertices.iter().for_each(|p| assert!(shape.nearest(*p).distance.abs() < 1e-15));
        }
    }
    let capsule = Shape::Capsule { ends: [DVec3::ZERO, DVec3::X], radius: 0.1 };
    let on_axis = capsule.nearest(0.25 * DVec3::X);
    assert!(on_axis.distance == -0.1 && on_axis.normal.x == 0.0, "{on_axis:?}");
}

#[test]
fn bounds_hold_the_shape_and_surfaces_lie_on_it() {
    for shape in shapes() {
        let mesh = shape.surface();
        assert!(mesh.is_watertight() && mesh.volume() > 0.0, "{shape:?}");
        let (low, high) = shape.aabb();
        let (centre, radius) = shape.bounds(0.0);
        let slack = 1e-12;
        for v in &mesh.vertices {
            assert!(v.cmpge(low - slack).all() && v.cmple(high + slack).all() && v.distance(centre) < radius + slack);
            assert!(shape.nearest(*v).distance.abs() < 1e-12, "{shape:?}");
        }
        for t in 0..mesh.triangles.len() {
            let middle = mesh.corners(t).iter().sum::<DVec3>() / 3.0;
            let near = shape.nearest(middle);
            assert!(near.distance.abs() < 0.011 * radius && near.normal.dot(mesh.area_vector(t)) > 0.0, "{shape:?}");
        }
        // Tight: every side of the box touches the surface.
        let (l, h) = mesh.bounds().unwrap();
        assert!((l - low).abs().max_element() < 0.02 * radius && (h - high).abs().max_element() < 0.02 * radius);
        assert!((shape.bounds(1e-3).1 - radius - 1e-3).abs() < 1e-15);
    }
    let half_space = Shape::HalfSpace { point: DVec3::ZERO, normal: DVec3::Z };
    assert!(half_space.surface().triangles.is_empty() && half_space.bounds(0.0).1 == f64::INFINITY);
    assert_eq!(half_space.aabb(), (DVec3::NEG_INFINITY, DVec3::INFINITY));
}

#[test]
fn parrys_gjk_agrees_outside() {
    for (at, (name, cloud, hull)) in hulls().into_iter().enumerate() {
        let Some(theirs) = ConvexPolyhedron::from_convex_hull(&cloud.iter().map(|p| to_parry(*p)).collect::<Vec<_>>())
        else {
            continue;
        };
        let shape = Shape::Hull(hull);
        for p in around(&shape, 13_000 * at as u64).take(500) {
            let near = shape.nearest(p);
            if near.distance > 1e-4 {
                let distance = theirs.distance_to_local_point(to_parry(p), true);
                assert!((near.distance - distance).abs() < 1e-7, "{name} at {p}: {near:?}, parry {distance}");
            }
        }
    }
}

#[test]
fn wrong_shapes_are_refused_by_name() {
    let refusal = |shape: Shape| {
        let collider = Collider { name: "jaw".into(), tool: 0, shape, rest_offset: 1e-3, friction: 0.1 };
        ModelBuilder::new().collider(collider).unwrap_err().to_string()
    };
    let nan = DVec3::new(0.0, f64::NAN, 0.0);
    let cases = [
        (Shape::Sphere { centre: nan, radius: 1e-3 }, "centre"),
        (Shape::Sphere { centre: DVec3::ZERO, radius: 0.0 }, "radius"),
        (Shape::Sphere { centre: DVec3::ZERO, radius: f64::NAN }, "radius"),
        (Shape::Sphere { centre: DVec3::ZERO, radius: f64::INFINITY }, "radius"),
        (Shape::Capsule { ends: [DVec3::ZERO, nan], radius: 1e-3 }, "second end"),
        (Shape::Capsule { ends: [DVec3::ZERO; 2], radius: -1e-3 }, "radius"),
        (Shape::HalfSpace { point: DVec3::ZERO, normal: DVec3::splat(1.0) }, "normal"),
        (Shape::HalfSpace { point: DVec3::ZERO, normal: nan }, "normal"),
        (
            Shape::Box { centre: DVec3::ZERO, rotation: DQuat::IDENTITY, half: DVec3::new(1.0, 0.0, 1.0) },
            "half an edge",
        ),
        (
            Shape::Box { centre: DVec3::ZERO, rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), half: DVec3::ONE },
            "rotation",
        ),
    ];
    for (shape, word) in cases {
        let message = refusal(shape);
        assert!(message.starts_with("collider 'jaw': ") && message.contains(word), "{message}");
    }
    for shape in shapes() {
        let collider = Collider { name: "jaw".into(), tool: 0, shape, rest_offset: 1e-3, friction: 0.1 };
        ModelBuilder::new().collider(collider).unwrap();
    }
}

#[test]
fn hulls_refuse_points_that_span_no_volume() {
    let refusal = |points: &[DVec3]| Hull::of(points).unwrap_err();
    assert!(refusal(&[]).contains("0 points"));
    assert!(refusal(&[DVec3::X; 3]).contains("3 points"));
    assert!(refusal(&[DVec3::X; 300]).contains("300 points"));
    assert!(refusal(&[DVec3::X; 9]).contains("within"));
    assert!(refusal(&[DVec3::ZERO, DVec3::NAN, DVec3::X, DVec3::Y]).contains("point 1"));
    assert!(refusal(&[DVec3::ZERO, DVec3::X * f64::INFINITY, DVec3::X, DVec3::Y]).contains("point 1"));
    let line: Vec<DVec3> = (0..9).map(|k| 1e-3 * k as f64 * DVec3::new(1.0, 2.0, -3.0)).collect();
    assert!(refusal(&line).contains("line"), "{}", refusal(&line));
    let turn = rotation(3);
    let flat: Vec<DVec3> = (0..40).map(|k| 1e-2 * (turn * (random(k) * DVec3::new(1.0, 1.0, 1e-6)))).collect();
    assert!(refusal(&flat).contains("plane"), "{}", refusal(&flat));
}

#[test]
fn points_far_apart_near_and_twice_make_a_hull_or_a_message() {
    for seed in 0..300u64 {
        let scale = [1e-12, 1e-9, 1e-6, 1e-4, 1.0][seed as usize % 5];
        let base: Vec<DVec3> = (0..8).map(|k| 1e-2 * random(1000 * seed + k).round()).collect();
        // Corners of a box, many of them, moved by next to nothing.
        let cloud: Vec<DVec3> =
            (0..64).map(|k| base[k % 8] + 1e-2 * scale * random(77_000 * seed + k as u64)).collect();
        if let Ok(hull) = Hull::of(&cloud) {
            assert!(hull.surface().is_watertight());
            cloud.iter().for_each(|p| assert!(hull.nearest(*p).distance < 1e-8));
        }
    }
}
