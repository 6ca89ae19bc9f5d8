//! Pure bending without a clamp, against theory, of beams that lie across the grid.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::{DQuat, DVec3, EulerRot};
use trocar_lattice::{
    Body, BodyDescription, BodyState, Conditions, Lattice, LatticeOptions, Law, Material, Newton, PointLoad, Precision,
    Spring,
};
use trocar_testing::blocks::block;

const SIZE: DVec3 = DVec3::new(24e-3, 8e-3, 6e-3);
const YOUNG: f64 = 12e3;

/// Relative lack of compliance of a beam whose ends are pulled and pushed as pure bending does. The
/// exact work of these loads is M^2 L/(E I) for any Poisson's ratio.
fn lack(turn: DQuat, poisson_ratio: f64, cell: f64) -> f64 {
    let mut mesh = block([12, 4, 3], 2e-3);
    mesh.vertices.iter_mut().for_each(|p| *p = turn * *p);
    let origin = Some(DVec3::new(-0.3, -0.35, -0.6) * cell);
    let lattice = Lattice::of_mesh(&mesh, &LatticeOptions { origin, ..LatticeOptions::new(cell) }).unwrap();
    let (mut places, mut forces, mut moment) = (Vec::new(), Vec::new(), 0.0);
    let count = 24;
    for k in 0..2 * count * count {
        let at = |i: usize| (i as f64 + 0.5) / count as f64;
        let (end, y, z) = ((k / (count * count)) as f64, at(k / count % count), at(k % count) - 0.5);
        let force = (2.0 * end - 1.0) * 1e-8 * z;
        moment += end * force * z * SIZE.z;
        places.push(turn * (SIZE * DVec3::new(end, y, z + 0.5)));
        forces.push(turn * (DVec3::X * force));
    }
    let points = lattice.embed(&places).unwrap();
    let load = |(point, force): (&trocar_lattice::EmbeddedPoint, &DVec3)| PointLoad { point: *point, force: *force };
    let loads: Vec<PointLoad> = points.iter().zip(&forces).map(load).collect();
    // The loads are in equilibrium; weak springs only keep the beam from drifting.
    let kept = lattice.embed(&[0, 12, 40, 100].map(|i| mesh.vertices[i])).unwrap();
    let spring = |point: &trocar_lattice::EmbeddedPoint| Spring {
        point: *point,
        target: point.interpolate(lattice.nodes()),
        stiffness: 1e-5,
    };
    let springs: Vec<Spring> = kept.iter().map(spring).collect();
    let material = Material { law: Law::Corotated, young_modulus: YOUNG, poisson_ratio, density: 1200.0 };
    let body = Body::new(BodyDescription { name: "beam".into(), lattice, material, pins: vec![], fixed: vec![] });
    let body = body.unwrap();
    let mut state = BodyState::new(&body);
    let mut newton = Newton::new(&body, Precision { gradient: 1e-10, ..Precision::default() }).unwrap();
    let conditions = Conditions { springs: &springs, loads: &loads, ..Conditions::default() };
    newton.settle(&body, &conditions, &mut state).unwrap();
    let moved = points.iter().zip(&places).map(|(point, p)| point.interpolate(&state.positions) - *p);
    let work: f64 = moved.zip(&forces).map(|(u, force)| force.dot(u)).sum();
    1.0 - work * YOUNG * SIZE.y * SIZE.z.powi(3) / 12.0 / (moment * moment * SIZE.x)
}

/// The error falls with the square of the cell, at any rotation and Poisson's ratio.
#[test]
fn turned_beams_converge_at_second_order() {
    for turn in [DQuat::IDENTITY, DQuat::from_euler(EulerRot::XYZ, 0.5, 0.4, 0.3)] {
        for nu in [0.0, 0.3, 0.45, 0.499] {
            let lack = [3e-3, 1.5e-3].map(|cell| lack(turn, nu, cell));
            let order = (lack[0] / lack[1]).log2();
            println!("turned by {:.1}, nu {nu}: too stiff by {lack:.4?}, order {order:.2}", turn.to_axis_angle().1);
            assert!(lack[0] < 0.11 && lack[1] > 0.0 && order > 1.7, "{lack:?}");
        }
    }
}
