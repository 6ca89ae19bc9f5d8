//! The lattice mesher on shapes with a closed-form distance.

mod common;

use common::{Shape, check_conforming};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use trocar_geometry::{Error, LatticeMesher, SignedDistance, TetQuality};

fn boxed(
    name: &'static str,
    half: DVec3,
    f: impl Fn(DVec3) -> f64 + Sync + 'static,
) -> (&'static str, DVec3, Box<dyn SignedDistance>) {
    (name, half, Box::new(Shape(f)))
}

fn segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a.lerp(b, t))
}

/// Shapes of a few centimetres, each with the half extent of its bounds.
fn shapes() -> Vec<(&'static str, DVec3, Box<dyn SignedDistance>)> {
    vec![
        boxed("sphere", DVec3::splat(0.03), |p| p.length() - 0.03),
        boxed("capsule", DVec3::new(0.04, 0.01, 0.01), |p| segment(p, DVec3::X * -0.03, DVec3::X * 0.03) - 0.01),
        boxed("torus", DVec3::new(0.04, 0.04, 0.01), |p| {
            DVec2::new(DVec2::new(p.x, p.y).length() - 0.03, p.z).length() - 0.01
        }),
        // A lower bound of the distance that is exact to first order at the surface along the
        // shortest axis.
        boxed("ellipsoid", DVec3::new(0.04, 0.025, 0.015), |p| {
            ((p / DVec3::new(0.04, 0.025, 0.015)).length() - 1.0) * 0.015
        }),
        boxed("thin plate", DVec3::new(0.03, 0.03, 0.003), |p| {
            let q = p.abs() - DVec3::new(0.027, 0.027, 0.0);
            q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - 0.003
        }),
        boxed("bent tube", DVec3::new(0.045, 0.045, 0.006), |p| {
            // Half a ring with round ends.
            let ends = p.distance(DVec3::X * 0.035).min(p.distance(DVec3::X * -0.035));
            let ring = DVec2::new(DVec2::new(p.x, p.y).length() - 0.035, p.z).length();
            if p.y > 0.0 { ring - 0.006 } else { ends - 0.006 }
        }),
        boxed("two balls and a neck", DVec3::new(0.04, 0.015, 0.015), |p| {
            let balls = (p - DVec3::X * 0.025).length().min((p + DVec3::X * 0.025).length()) - 0.015;
            balls.min(segment(p, DVec3::X * -0.025, DVec3::X * 0.025) - 0.0025)
        }),
        boxed("noisy ball", DVec3::splat(0.036), |p| {
            let q = p * 400.0;
            0.7 * (p.length() - 0.03) + 0.001 * (q.x.sin() * q.y.cos() + (1.7 * q.z + 0.6).sin() * (1.3 * q.x).cos())
        }),
        // A field with details of the size of the lattice: pinches, fragments and bubbles.
        boxed("foam", DVec3::splat(0.04), |p| {
            let q = p * 1500.0;
            let gyroid = q.x.sin() * q.y.cos() + q.y.sin() * q.z.cos() + q.z.sin() * q.x.cos();
            (p.length() - 0.03).max(gyroid / 2600.0)
        }),
    ]
}

#[test]
fn every_shape_gives_a_valid_body() {
    for (name, half, shape) in shapes() {
        for cell in [0.0031, 0.0019] {
            let mesher = LatticeMesher::uniform(cell);
            let mesh = mesher.mesh_shape(shape.as_ref(), (-half, half)).unwrap();
            let quality = TetQuality::of(&mesh);
            let touching = check_conforming(&mesh);
            assert!(quality.min_dihedral_deg > 10.7 && quality.max_dihedral_deg < 165.0, "{name}: {quality:?}");
            assert_eq!(quality.inverted, 0, "{name}");
            let used: std::collections::BTreeSet<u32> = mesh.tets.iter().flatten().copied().collect();
            assert_eq!(used.len(), mesh.vertices.len(), "{name}: unused nodes");
            if name != "foam" && name != "noisy ball" {
                assert_eq!(touching, 0, "{name}");
                let (surface, _) = mesh.boundary();
                let worst = surface.vertices.iter().map(|&p| shape.distance(p).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-3 * cell, "{name}: a boundary node {worst} m off the surface");
            }
        }
    }
}

#[test]
fn the_volume_of_a_sphere_converges_at_second_order() {
    let radius = 0.03;
    let truth = 4.0 / 3.0 * PI * radius * radius * radius;
    let errors = [0.006, 0.003, 0.0015].map(|cell| {
        let mesh = LatticeMesher::uniform(cell).mesh_shape(&Shape(|p| p.length() - radius), cube(radius)).unwrap();
        (truth - mesh.volume()) / truth
    });
    assert!(errors[2] > 0.0 && errors[2] < 1e-3, "nodes on a convex surface enclose less");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.7..2.4).contains(&order), "order {order}");
    }
}

#[test]
fn the_mesh_does_not_depend_on_threads() {
    let half = DVec3::splat(0.03);
    let mesh = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| LatticeMesher::uniform(0.002).mesh_shape(&Shape(|p| p.length() - 0.03), (-half, half)).unwrap())
    };
    assert_eq!(mesh(1), mesh(4));
}

#[test]
fn only_the_largest_part_is_kept() {
    let two = Shape(|p| (p.length() - 0.02).min((p - DVec3::X * 0.05).length() - 0.01));
    let mesh =
        LatticeMesher::uniform(0.002).mesh_shape(&two, (DVec3::splat(-0.02), DVec3::new(0.06, 0.02, 0.02))).unwrap();
    let (_, hi) = mesh.bounds().unwrap();
    assert!(hi.x < 0.0201);
}

#[test]
fn unusable_input_is_rejected_with_a_reason() {
    let ball = |r: f64| Shape(move |p: DVec3| p.length() - r);
    let rejection =
        |shape: &dyn SignedDistance, bounds, cell| match LatticeMesher::uniform(cell).mesh_shape(shape, bounds) {
            Err(Error::Mesh(message)) => message,
            other => panic!("accepted: {other:?}"),
        };
    let unit = cube(1.0);
    assert!(rejection(&ball(1.0), unit, 0.0).contains("positive length"));
    assert!(rejection(&ball(1.0), unit, f64::NAN).contains("positive length"));
    assert!(rejection(&ball(1.0), (DVec3::ONE, DVec3::ZERO), 0.1).contains("not a box"));
    assert!(rejection(&ball(1.0), unit, 1e-5).contains("too fine"));
    assert!(rejection(&ball(-1.0), unit, 0.1).contains("empty"));
    assert!(rejection(&ball(1e-4), unit, 0.1).contains("finer cell"));
    assert!(rejection(&ball(2.0), cube(0.5), 0.1).contains("beyond its bounds"));
    assert!(rejection(&Shape(|_| f64::NAN), unit, 0.1).contains("must be finite"));
}

fn cube(half: f64) -> (DVec3, DVec3) {
    (DVec3::splat(-half), DVec3::splat(half))
}
