//! The graded lattice: valid meshes with the surface of a uniform lattice and far fewer elements in
//! a large body.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod common;

use common::{Shape, check_conforming};
use glam::{DQuat, DVec3};
use std::path::PathBuf;
use trocar_core::Random;
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{LatticeMesher, Mesher, SignedDistance, TetMesh, TetQuality, TriMesh, repair};

type Named = (String, DVec3, Box<dyn SignedDistance>);

fn named(name: &str, half: DVec3, f: impl Fn(DVec3) -> f64 + Sync + 'static) -> Named {
    (name.to_owned(), half, Box::new(Shape(f)))
}

fn box_distance(p: DVec3, half: DVec3) -> f64 {
    let q = p.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}

/// A ball with waves of random direction, length and phase, with the largest slope the mesher
/// accepts.
fn blob(seed: u64) -> Named {
    let mut numbers = Random::new(seed).sequence();
    let mut next = || 2.0 * numbers.uniform() - 1.0;
    let waves: Vec<(DVec3, f64)> = (0..6).map(|_| (150.0 * DVec3::new(next(), next(), next()), 3.0 * next())).collect();
    named(&format!("blob {seed}"), DVec3::splat(0.05), move |p| {
        // Six waves of at most 260 rad/m and 0.6 mm have a total slope of at most 0.94. The slope
        // of the ball is reduced accordingly.
        let rough: f64 = waves.iter().map(|(k, phase)| 6e-4 * (k.dot(p) + phase).sin()).sum();
        0.3 * (p.length() - 0.03) + rough
    })
}

/// Shapes with half the extent of their bounds (m), for cells of 2.5 mm.
fn shapes() -> Vec<Named> {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 0.2);
    let mut shapes = vec![
        named("ball", DVec3::splat(0.045), |p| p.length() - 0.045),
        named("small ball", DVec3::splat(0.005), |p| p.length() - 0.005),
        named("shifted ball", DVec3::splat(0.031), |p| (p - DVec3::new(3e-4, 7e-4, -4e-4)).length() - 0.03),
        named("thin tube", DVec3::new(0.06, 0.003, 0.003), |p| {
            (p - DVec3::X * p.x.clamp(-0.057, 0.057)).length() - 0.003
        }),
        named("slab", DVec3::new(0.05, 0.04, 0.006), |p| box_distance(p, DVec3::new(0.05, 0.04, 0.006))),
        named("touching balls", DVec3::new(0.04, 0.02, 0.02), |p| {
            (p - DVec3::X * 0.02).length().min((p + DVec3::X * 0.02).length()) - 0.02
        }),
        named("torus", DVec3::new(0.05, 0.05, 0.016), |p| (p.x.hypot(p.y) - 0.034).hypot(p.z) - 0.016),
        named("rotated box", DVec3::splat(0.05), move |p| box_distance(turn * p, DVec3::new(0.03, 0.025, 0.02))),
        named("hollow ball", DVec3::splat(0.04), |p| (p.length() - 0.04).max(0.015 - p.length())),
    ];
    shapes.extend((1..=4).map(blob));
    shapes
}

/// The sorted triangles of the surface, as bits of their corners, each starting with its smallest
/// corner.
fn surface_of(mesh: &TetMesh) -> Vec<[[u64; 3]; 3]> {
    let (surface, _) = mesh.boundary();
    let mut triangles: Vec<[[u64; 3]; 3]> = (0..surface.triangles.len())
        .map(|t| {
            let mut corners = surface.corners(t).map(|p| p.to_array().map(f64::to_bits));
            let first = (0..3).min_by_key(|&i| corners[i]).unwrap();
            corners.rotate_left(first);
            corners
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

/// Checks the properties of every mesh and returns its quality.
fn check(name: &str, mesh: &TetMesh) -> TetQuality {
    check_conforming(mesh);
    let quality = TetQuality::of(mesh);
    assert!(quality.min_dihedral_deg > 10.7 && quality.max_dihedral_deg < 165.0, "{name}: {quality:?}");
    assert_eq!(quality.inverted, 0, "{name}");
    let enclosed = mesh.boundary().0.volume();
    assert!((quality.volume / enclosed - 1.0).abs() < 1e-10, "{name}: {} in {enclosed} m3", quality.volume);
    quality
}

#[test]
fn every_shape_gives_a_valid_mesh_and_keeps_its_surface() {
    let mut most = 1.0f64;
    for (name, half, shape) in shapes() {
        let mesh =
            |coarsest| LatticeMesher { cell: 0.0025, coarsest }.mesh_shape(shape.as_ref(), (-half, half)).unwrap();
        let uniform = mesh(1);
        check(&name, &uniform);
        let surface = surface_of(&uniform);
        let mut counts = vec![uniform.tets.len()];
        for coarsest in [2, 64] {
            let graded = mesh(coarsest);
            let quality = check(&name, &graded);
            assert!(surface_of(&graded) == surface, "{name}: the surface depends on the grading");
            assert!((quality.volume / uniform.volume() - 1.0).abs() < 1e-10, "{name}");
            assert!(graded.tets.len() <= *counts.last().unwrap());
            counts.push(graded.tets.len());
        }
        most = most.max(counts[0] as f64 / counts[2] as f64);
    }
    assert!(most > 2.5, "no shape has far fewer elements: {most}");
}

#[test]
fn the_mesh_does_not_depend_on_threads() {
    let (_, half, shape) = blob(7);
    let mesh = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| LatticeMesher::graded(0.0015).mesh_shape(shape.as_ref(), (-half, half)).unwrap())
    };
    assert!(mesh(1) == mesh(3));
}

/// The inside of a graded body is neither sampled nor stored. Halving the cell multiplies the cost
/// by four, not eight.
#[test]
fn the_cost_is_proportional_to_the_surface() {
    let cost = |cell: f64| {
        let evaluations = std::sync::atomic::AtomicUsize::new(0);
        let ball = Shape(|p: DVec3| {
            evaluations.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            p.length() - 0.05
        });
        let mesh =
            LatticeMesher { cell, coarsest: 64 }.mesh_shape(&ball, (DVec3::splat(-0.05), DVec3::splat(0.05))).unwrap();
        (mesh.tets.len() as f64, evaluations.into_inner() as f64)
    };
    let (coarse, fine) = (cost(0.003), cost(0.0015));
    assert!(fine.0 < 5.0 * coarse.0 && fine.1 < 5.0 * coarse.1);
}

#[test]
fn a_cell_that_is_too_small_is_rejected_before_allocation() {
    let half = DVec3::splat(0.05);
    let ball = Shape(|p: DVec3| p.length() - 0.05);
    let message = LatticeMesher::uniform(0.0005).mesh_shape(&ball, (-half, half)).unwrap_err().to_string();
    assert!(message.contains("30 million"), "{message}");
    assert!(LatticeMesher::graded(1e-6).mesh_shape(&ball, (-half, half)).unwrap_err().to_string().contains("too fine"));
}

/// A ball as triangles between circles of latitude and longitude.
fn ball(radius: f64) -> TriMesh {
    let (rings, spokes) = (40u32, 60u32);
    let mut mesh = TriMesh { vertices: vec![DVec3::Z * radius], triangles: Vec::new(), colors: Vec::new() };
    for ring in 1..rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        mesh.vertices.extend((0..spokes).map(|spoke| {
            let phi = std::f64::consts::TAU * f64::from(spoke) / f64::from(spokes);
            radius * DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        }));
    }
    mesh.vertices.push(DVec3::NEG_Z * radius);
    let last = mesh.vertices.len() as u32 - 1;
    let at = |ring: u32, spoke: u32| 1 + (ring - 1) * spokes + spoke % spokes;
    for spoke in 0..spokes {
        mesh.triangles.push([0, at(1, spoke), at(1, spoke + 1)]);
        mesh.triangles.push([last, at(rings - 1, spoke + 1), at(rings - 1, spoke)]);
        for ring in 1..rings - 1 {
            let [a, b, c, d] = [at(ring, spoke), at(ring + 1, spoke), at(ring + 1, spoke + 1), at(ring, spoke + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn the_cell_matches_the_budget() {
    let ball = ball(0.05);
    assert_eq!(LatticeMesher::for_body(&ball, 0.01, 1_000_000).cell, 0.01);
    for budget in [5_000, 50_000, 100_000] {
        let (mesher, mesh) = LatticeMesher::fit(&ball, 1e-4, budget).unwrap();
        let part = mesh.tets.len() as f64 / budget as f64;
        assert!((0.8..1.1).contains(&part));
        assert!(mesher.mesh(&ball).unwrap() == mesh);
    }
    // A long wire of 0.3 mm: no cell size gives so few elements, so the budget is exceeded.
    let wire = TriMesh { vertices: ball.vertices.iter().map(|v| *v * DVec3::new(1.0, 0.01, 0.01)).collect(), ..ball };
    let (mesher, mesh) = LatticeMesher::fit(&wire, 1e-4, 10).unwrap();
    assert!(!mesh.tets.is_empty() && mesher.cell > 1e-4);
    // No volume to divide by.
    assert_eq!(LatticeMesher::for_body(&TriMesh::default(), 0.003, 10).cell, 0.003);
    assert!(LatticeMesher::fit(&TriMesh::default(), 0.003, 10).is_err());
}

#[test]
fn organs_give_valid_meshes() {
    for file in
        ["openhelp/Liver.stl", "openhelp/Duodenum.stl", "lapgym_organs/grasp_lift_touch__gallbladder_visual.stl"]
    {
        let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(file);
        if !path.exists() {
            println!("skipped: {} absent", path.display());
            continue;
        }
        let (organ, _) = repair(&read_surface(&path, Unit::Millimetre).unwrap()).unwrap();
        let (mesher, mesh) = LatticeMesher::fit(&organ, 1e-4, 50_834).unwrap();
        check(file, &mesh);
        let uniform = LatticeMesher::uniform(mesher.cell).mesh(&organ).unwrap();
        assert!((0.9..1.1).contains(&(mesh.tets.len() as f64 / 50_834.0)));
        assert!(surface_of(&uniform) == surface_of(&mesh));
    }
}
