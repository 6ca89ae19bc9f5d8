//! What is known of a lattice from before changes no bit.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use crate::{
    Backend, BodyDescription, ConstitutiveModel, LatticeSettings, Material, Model, ModelBuilder, SolverSettings, State,
    Stepper,
};
use glam::DVec3;
use trocar_testing::blocks::block;

/// A block that hangs on its upper end.
fn model() -> Model {
    let mesh = block([2, 2, 4], 5e-3);
    let highest = mesh.vertices.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z > highest - 1e-6).collect();
    let material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1050.0,
        viscosity: 5.0,
    };
    let backend = Backend::Lattice(LatticeSettings { cell: 5e-3, ..LatticeSettings::default() });
    let mut builder = ModelBuilder::new().backend(backend).gravity(DVec3::Z * -9.81);
    let body = BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] };
    builder.body(body).unwrap();
    builder.build().unwrap()
}

fn stepper(model: &Model) -> Stepper {
    Stepper::new(model, SolverSettings::default(), 1.0 / 60.0, 1).unwrap()
}

#[test]
fn vertices_that_follow_need_not_be_looked_at() {
    let model = model();
    let (mut state, mut known) = (State::new(&model), stepper(&model));
    for frame in 0..60 {
        let mut again = state.clone();
        again.bodies[0].follows = false;
        known.step(&model, &mut state, &[]);
        assert!(state.bodies[0].follows);
        // Another stepper knows nothing from before.
        stepper(&model).step(&model, &mut again, &[]);
        assert_eq!(again.hash(), state.hash(), "frame {frame}");
    }
}

#[test]
fn vertices_that_were_moved_are_followed() {
    let model = model();
    let (mut state, mut stepper) = (State::new(&model), stepper(&model));
    stepper.step(&model, &mut state, &[]);
    let lowest = (0..model.bodies[0].len())
        .min_by(|a, b| state.position(&model, 0, *a).z.total_cmp(&state.position(&model, 0, *b).z));
    let lowest = lowest.unwrap();
    let still = state.clone();
    state.set_velocity(&model, 0, lowest, DVec3::X);
    assert!(!state.bodies[0].follows);
    stepper.step(&model, &mut state, &[]);
    let mut other = still.clone();
    stepper.step(&model, &mut other, &[]);
    assert!(state.position(&model, 0, lowest).x > other.position(&model, 0, lowest).x + 1e-5);

    let mut state = still.clone();
    state.set_motion(&model, 0, &still.motion(&model, 0));
    assert!(!state.bodies[0].follows);
    stepper.step(&model, &mut state, &[]);
    assert_eq!(state.position(&model, 0, lowest), other.position(&model, 0, lowest));
}
