//! Equilibria against theory: patch test, column, rigid rotation, near-incompressible beams.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::{DMat3, DQuat, DVec3};
use trocar_geometry::TetMesh;
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, Lattice, LatticeOptions, Law, Material, Newton, PointLoad, Precision,
};
use trocar_testing::blocks::{appendix, block};

fn material(law: Law, poisson_ratio: f64) -> Material {
    Material { law, young_modulus: 12e3, poisson_ratio, density: 1200.0 }
}

/// A body of `mesh` in cells of `cell` (m). Its fixed nodes are those at which `fixed` holds.
fn body(mesh: &TetMesh, options: LatticeOptions, material: Material, fixed: impl Fn(DVec3) -> bool) -> Body {
    let lattice = Lattice::of_mesh(mesh, &options).unwrap();
    let fixed = (0..lattice.nodes().len() as u32).filter(|i| fixed(lattice.nodes()[*i as usize])).collect();
    Body::new(BodyDescription { name: "body".into(), lattice, material, pins: vec![], fixed }).unwrap()
}

/// With its outer nodes moved by an affine field, a block of full cells is affine inside.
#[test]
fn the_patch_test_is_passed() {
    let mesh = block([4, 3, 3], 3e-3);
    let (_, high) = mesh.bounds().unwrap();
    let affine = DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(-0.1, 0.9, 0.15), DVec3::new(0.05, -0.2, 1.2));
    for law in Law::ALL {
        for nu in [0.3, 0.45, 0.499] {
            let outer = |p: DVec3| (p.min(high - p)).min_element() < 1e-9;
            let body = body(&mesh, LatticeOptions::new(1.5e-3), material(law, nu), outer);
            let mut state = BodyState::new(&body);
            for (p, fixed) in state.positions.iter_mut().zip(body.fixed()) {
                *p = if *fixed { affine * *p } else { affine * *p + 2e-4 * DVec3::new((9e3 * p.x).sin(), 0.3, -0.4) };
            }
            let mut newton = Newton::new(&body, Precision::default()).unwrap();
            let solution = newton.settle(&body, &Conditions::default(), &mut state).unwrap();
            let pairs = state.positions.iter().zip(body.lattice().nodes());
            let off = pairs.map(|(x, p)| (*x - affine * *p).length()).fold(0.0, f64::max);
            println!("{law:?}, nu {nu}: off by {off:.1e} m after {solution:?}");
            assert!(off < 1e-10, "{law:?}, nu {nu}: {off}");
        }
    }
}

/// A column that hangs by its weight, nu = 0: the linear solution is u = rho g (L z - z^2/2)/E.
#[test]
fn a_column_stretches_as_theory_says() {
    let (length, share) = (24e-3, 1e-3);
    let mesh = block([2, 2, 12], 2e-3);
    for law in Law::ALL {
        // One grid fits the column, the others cut it.
        for (cell, most) in [(2e-3, 1e-3), (1.7e-3, 5e-3), (2.9e-3, 5e-3)] {
            let origin = Some(DVec3::new(-0.3e-3, -0.4e-3, 0.0));
            let origin = origin.filter(|_| cell != 2e-3);
            let options = LatticeOptions { origin, ..LatticeOptions::new(cell) };
            let body = body(&mesh, options, material(law, 0.0), |p| p.z < 1e-9);
            let mut state = BodyState::new(&body);
            let mut newton = Newton::new(&body, Precision { gradient: 1e-11, ..Precision::default() }).unwrap();
            newton.settle(&body, &Conditions::gravity(DVec3::Z * 9.81 * share), &mut state).unwrap();
            let points = body.lattice().embed_nodes().unwrap();
            let scale = 1200.0 * 9.81 * share / 12e3;
            let mut off = 0.0f64;
            for (p, point) in mesh.vertices.iter().zip(&points) {
                let exact = DVec3::Z * scale * (length * p.z - 0.5 * p.z * p.z);
                off = off.max((point.interpolate(&state.positions) - *p - exact).length());
            }
            let off = off / (0.5 * scale * length * length);
            println!("{law:?}, {} mm: off by {off:.1e} of the stretch of the end", 1e3 * cell);
            assert!(off < most, "{law:?}, {cell}: {off}");
        }
    }
}

/// An organ that is turned and pinned nowhere comes to rest in its rest shape, turned.
#[test]
fn rest_is_an_equilibrium_at_any_rotation() {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 2.0, -1.0, 0.5));
    for law in Law::ALL {
        let body = body(&appendix(3e-3), LatticeOptions::new(3e-3), material(law, 0.45), |_| false);
        let mut state = BodyState::new(&body);
        state.positions.iter_mut().for_each(|p| *p = turn * *p);
        let before = state.clone();
        let solution =
            Newton::new(&body, Precision::default()).unwrap().settle(&body, &Conditions::default(), &mut state);
        assert_eq!(solution.unwrap().iterations, 0);
        assert_eq!(state, before);
    }
}

/// A clamped beam under a load at its end, over Timoshenko's deflection, with nearly incompressible
/// tissue: full integration of the volumetric part would lock.
#[test]
fn nearly_incompressible_beams_do_not_lock() {
    let (length, height, load) = (40e-3f64, 8e-3f64, 1e-5);
    let mesh = block([10, 2, 2], 4e-3);
    for law in Law::ALL {
        let mut deflections = Vec::new();
        for nu in [0.3, 0.45, 0.49, 0.499, 0.4999] {
            let body = body(&mesh, LatticeOptions::new(2e-3), material(law, nu), |p| p.x < 1e-9);
            let mut state = BodyState::new(&body);
            let tip: Vec<DVec3> = mesh.vertices.iter().copied().filter(|p| p.x > length - 1e-9).collect();
            let points = body.lattice().embed(&tip).unwrap();
            let force = DVec3::Z * load / tip.len() as f64;
            let loads: Vec<PointLoad> = points.iter().map(|point| PointLoad { point: *point, force }).collect();
            let mut newton = Newton::new(&body, Precision::default()).unwrap();
            newton.settle(&body, &Conditions { loads: &loads, ..Conditions::default() }, &mut state).unwrap();
            let moved =
                |(p, point): (&DVec3, &trocar_lattice::EmbeddedPoint)| point.interpolate(&state.positions).z - p.z;
            let deflection = tip.iter().zip(&points).map(moved).sum::<f64>() / tip.len() as f64;
            let (inertia, shear) = (height.powi(4) / 12.0, 12e3 / (2.0 * (1.0 + nu)));
            let theory = load * length.powi(3) / (3.0 * 12e3 * inertia)
                + load * length / (10.0 * (1.0 + nu) / (12.0 + 11.0 * nu) * shear * height * height);
            deflections.push(deflection / theory);
        }
        println!("{law:?}: {deflections:.4?} of theory");
        assert!(deflections.iter().all(|d| (0.9..1.05).contains(d)), "{law:?}: {deflections:?}");
        assert!(deflections[4] > 0.96 * deflections[1], "{law:?} locks: {deflections:?}");
    }
}
