//! Conforming supports: an organ lies in its imprint without being pushed, and on it as on any
//! support.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, tissue};
use trocar_tissue::{
    BodyDescription, Material, Model, ModelBuilder, SolverSettings, State, Stepper, Support, SupportField, SupportPlane,
};
use trocar_tissue_reference::{Oracle, OracleState};

/// A block bent into a cushion: its underside is a bowl of 1 mm depth, its sides bulge over it.
fn cushion() -> TetMesh {
    let mut mesh = block([12, 10, 4], 2e-3);
    for p in &mut mesh.vertices {
        let (u, v) = ((p.x - 12e-3) / 12e-3, (p.y - 10e-3) / 10e-3);
        let bulge = 1.0 + 0.15 * (p.z / 8e-3) * (1.0 - p.z / 8e-3);
        *p = DVec3::new(12e-3 + 12e-3 * u * bulge, 10e-3 + 10e-3 * v * bulge, p.z + 1.5e-3 * (u * u + 0.7 * v * v));
    }
    mesh
}

fn lying(mesh: &TetMesh, support: Support, gravity: DVec3) -> Model {
    let mut builder = ModelBuilder::new().gravity(gravity);
    let material = Material { viscosity: 4.0, ..tissue(12e3) };
    let supports = vec![support];
    builder.body(BodyDescription { name: "cushion".into(), mesh, material, pinned: vec![], supports }).unwrap();
    builder.build().unwrap()
}

#[test]
fn the_imprint_touches_the_underside_and_pushes_nothing() {
    let mesh = cushion();
    for up in [DVec3::Z, DVec3::new(0.2, -0.1, 1.0)] {
        let field: Support = SupportField::under(&mesh, up, 1e-3, 0.5).unwrap().into();
        let heights: Vec<f64> = mesh.vertices.iter().map(|p| field.height(*p)).collect();
        assert!(heights.iter().all(|h| *h >= 0.0), "{:?}", heights.iter().copied().fold(0.0, f64::min));
        // Under the middle of the foot, away from the outline, the gap is far below the imprint's
        // depth.
        let foot = mesh.vertices.iter().zip(&heights).take(13 * 11);
        let inner = foot.filter(|(p, _)| (p.x - 12e-3).abs() < 8e-3 && (p.y - 10e-3).abs() < 6e-3);
        let widest = inner.map(|(_, h)| *h).fold(0.0, f64::max);
        println!("up {up}: {:.3} mm between foot and imprint at most", widest * 1e3);
        assert!(widest < 2e-4, "{widest} m");
    }
    // Without gravity nothing moves at all: not a bit.
    let field = SupportField::under(&mesh, DVec3::Z, 1e-3, 0.5).unwrap();
    let model = lying(&mesh, field.into(), DVec3::ZERO);
    let mut state = State::new(&model);
    let rest = state.positions(&model, 0);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 1).unwrap();
    for _ in 0..30 {
        stepper.step(&model, &mut state, &[]);
    }
    let moved = state.positions(&model, 0).iter().zip(&rest).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(moved < 2e-8, "{moved} m: the support pushes");
}

/// An organ moves far less into its imprint than on a plane, and the sweeps find the oracle's
/// place.
#[test]
fn an_organ_rests_in_its_imprint() {
    let mesh = cushion();
    let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction: 0.5 };
    let field = SupportField::under(&mesh, DVec3::Z, 1e-3, 0.5).unwrap();
    let mut moved = Vec::new();
    for support in [Support::from(plane), field.into()] {
        let model = lying(&mesh, support, GRAVITY);
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 1).unwrap();
        let mut exact = OracleState::new(&model);
        let mut oracle = Oracle::new(&model);
        for _ in 0..60 {
            stepper.step(&model, &mut state, &[]);
        }
        // Where friction lets a body come to rest depends on its way there: the same substeps.
        for _ in 0..120 {
            oracle.step(&model, &mut exact, 0.5 * FRAME, &[]).unwrap();
        }
        let place = state.positions(&model, 0);
        let most = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        moved.push((
            most(&place, &mesh.vertices),
            most(&place, exact.positions(0)),
            most(exact.positions(0), &mesh.vertices),
        ));
    }
    println!("moved, off the oracle, oracle moved [m]: plane {:?}, imprint {:?}", moved[0], moved[1]);
    assert!(moved[1].0 < 0.5 * moved[0].0, "{moved:?}");
    assert!(moved[1].1 < 0.1 * moved[1].2, "{moved:?}");
}

#[test]
fn unusable_fields_are_refused() {
    let mesh = cushion();
    for (up, cell, friction, word) in [
        (DVec3::ZERO, 1e-3, 0.5, "direction"),
        (DVec3::Z, 0.0, 0.5, "cells"),
        (DVec3::Z, 1e-9, 0.5, "larger"),
        (DVec3::Z, f64::NAN, 0.5, "cells"),
        (DVec3::Z, 1e-3, -0.1, "friction"),
    ] {
        let said = SupportField::under(&mesh, up, cell, friction).unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    }
    assert!(SupportField::under(&TetMesh::default(), DVec3::Z, 1e-3, 0.5).is_err());
}
