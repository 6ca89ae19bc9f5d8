//! What must hold whatever happens: no inversion, pins that stay, exact grasps, the same bits.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, nodes, tissue};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Grasp, Material, Model, ModelBuilder, SolverSettings, State, Stepper, Support,
    SupportField, SupportPlane, ToolMotion,
};

fn lifted(height: f64) -> Pose {
    Pose { translation: DVec3::Z * height, ..Pose::IDENTITY }
}

/// Grasps the top of a block pinned at its foot and moves it by `travel` in `frames` frames;
/// returns the most elements inverted in any frame.
fn drag(model: &Model, mesh: &TetMesh, top: f64, travel: f64, frames: usize) -> (usize, State) {
    let mut state = State::new(model);
    let mut stepper = Stepper::new(model, SolverSettings::default(), FRAME, 0).unwrap();
    let held = nodes(mesh, |p| p.z > top);
    state.grasps = vec![Grasp::capture(model, &state, 0, &held, 0, &Pose::IDENTITY)];
    let mut worst = 0;
    for k in 0..frames {
        let at = |k: usize| lifted(travel * k as f64 / frames as f64);
        let report = stepper.step(model, &mut state, &[ToolMotion { from: at(k), to: at(k + 1) }]);
        assert_eq!(report.divergence, None);
        assert!(report.min_volume_ratio > 0.0);
        worst = worst.max(report.inverted);
    }
    (worst, state)
}

#[test]
fn nothing_inverts_when_squeezed_or_pulled_hard() {
    let mesh = block([4, 4, 6], 2e-3);
    // St. Venant-Kirchhoff tissue cannot hold a squeezed element; only the guard does.
    for (constitutive, young_modulus) in [
        (ConstitutiveModel::StableNeoHookean, 3e3),
        (ConstitutiveModel::StableNeoHookean, 12e3),
        (ConstitutiveModel::StableNeoHookean, 48e3),
        (ConstitutiveModel::Corotated, 3e3),
        (ConstitutiveModel::Corotated, 48e3),
    ] {
        let material = Material { model: constitutive, ..tissue(young_modulus) };
        let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
        // To a third of its height, and by two and a half times its height, each in half a second.
        for travel in [-8e-3, 30e-3] {
            let (worst, state) = drag(&model, &mesh, 11e-3, travel, 30);
            assert_eq!(worst, 0, "{constitutive:?}, {young_modulus} Pa, {travel} m");
            for i in nodes(&mesh, |p| p.z == 0.0) {
                assert_eq!(state.position(&model, 0, i as usize), State::new(&model).position(&model, 0, i as usize));
            }
        }
    }
}

#[test]
fn a_tool_faster_than_the_tissue_is_followed_later() {
    let mesh = block([4, 4, 6], 2e-3);
    let model = model(&mesh, tissue(3e3), nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    // 10 mm down in one frame, through the pinned foot's neighbours if nothing held it.
    let (worst, _) = drag(&model, &mesh, 11e-3, -10e-3, 1);
    assert_eq!(worst, 0);
}

#[test]
fn the_grasp_is_exact_when_it_closes() {
    let mesh = block([3, 3, 3], 2e-3);
    let model = model(&mesh, tissue(12e3), vec![], GRAVITY);
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 1).unwrap();
    for _ in 0..7 {
        stepper.step(&model, &mut state, &[]);
    }
    let tool = Pose {
        rotation: DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.2),
        translation: DVec3::new(0.11, -0.07, 0.31),
    };
    let grasp = Grasp::capture(&model, &state, 0, &[0, 5, 17], 0, &tool);
    for (node, x) in grasp.prescribed(&tool) {
        assert_eq!(x, state.position(&model, 0, node as usize));
    }
    // Elsewhere it is the paper's equation (4).
    let moved = Pose { rotation: DQuat::from_rotation_y(0.8) * tool.rotation, translation: DVec3::new(0.1, 0.0, 0.3) };
    for (node, x) in grasp.prescribed(&moved) {
        let offset = tool.inverse().transform(state.position(&model, 0, node as usize));
        assert!((x - moved.transform(offset)).length() < 1e-15);
    }
}

#[test]
fn held_nodes_follow_the_tool_and_are_free_afterwards() {
    let mesh = block([4, 4, 6], 2e-3);
    let model = model(&mesh, Material { viscosity: 4.0, ..tissue(12e3) }, nodes(&mesh, |p| p.z == 0.0), DVec3::ZERO);
    let (_, mut state) = drag(&model, &mesh, 11e-3, 4e-3, 30);
    let top = nodes(&mesh, |p| p.z > 11e-3);
    let rest = State::new(&model).centroid(&model, 0, &top);
    assert!((state.centroid(&model, 0, &top) - rest - DVec3::Z * 4e-3).length() < 1e-7);
    state.grasps.clear();
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 1).unwrap();
    for _ in 0..120 {
        stepper.step(&model, &mut state, &[]);
    }
    assert!((state.centroid(&model, 0, &top) - rest).length() < 1e-5, "it springs back to its rest shape");
}

/// Two bodies, one large enough to be swept by many tasks.
fn two_bodies() -> (Model, Vec<u32>) {
    let (large, small) = (block([20, 20, 12], 1.5e-3), block([5, 4, 3], 2e-3));
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let mut add = |name: &str, mesh: &TetMesh, material| {
        let pinned = nodes(mesh, |p| p.z == 0.0);
        builder.body(BodyDescription { name: name.into(), mesh, material, pinned, supports: vec![] }).unwrap();
    };
    add("large", &large, Material { viscosity: 4.0, ..tissue(12e3) });
    add("small", &small, Material { model: ConstitutiveModel::StVenantKirchhoff, ..tissue(30e3) });
    (builder.build().unwrap(), nodes(&large, |p| p.z > 16e-3 && p.x < 8e-3))
}

#[test]
fn the_same_bits_for_any_run_and_any_number_of_threads() {
    let (model, held) = two_bodies();
    let run = |threads: usize| {
        let mut state = State::new(&model);
        state.grasps = vec![Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY)];
        let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, threads).unwrap();
        for k in 0..6 {
            let motion = ToolMotion { from: lifted(5e-4 * k as f64), to: lifted(5e-4 * (k + 1) as f64) };
            stepper.step(&model, &mut state, &[motion]);
        }
        state.hash()
    };
    let one = run(1);
    for threads in [1, 2, 3, 8] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}

#[test]
fn a_saved_state_goes_on_as_if_nothing_had_happened() {
    let (model, _) = two_bodies();
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 2).unwrap();
    let mut state = State::new(&model);
    for _ in 0..3 {
        stepper.step(&model, &mut state, &[]);
    }
    let saved = state.clone();
    let mut go_on = |mut state: State| {
        for _ in 0..3 {
            stepper.step(&model, &mut state, &[]);
        }
        state.hash()
    };
    let first = go_on(state);
    assert_eq!(first, go_on(saved.clone()));
    assert_ne!(first, saved.hash());
}

/// A crumb of tissue that nothing holds comes to rest on what supports it, however light it is.
#[test]
fn light_bodies_come_to_rest_on_their_supports() {
    let up = DVec3::new(0.1, 0.0, 1.0).normalize();
    for edge in [2e-3, 8e-3] {
        let mesh = block([2, 1, 1], edge);
        let plane = SupportPlane { point: DVec3::Z * -edge, normal: up, friction: 0.4 };
        let field = SupportField::under(&mesh, up, 1e-3, 0.4).unwrap();
        for (name, support) in [("plane", Support::from(plane)), ("field", field.into())] {
            let mut builder = ModelBuilder::new().gravity(GRAVITY);
            let material = Material { viscosity: 4.0, ..tissue(12e3) };
            let (name, supports) = (name.to_owned(), vec![support]);
            builder.body(BodyDescription { name, mesh: &mesh, material, pinned: vec![], supports }).unwrap();
            let model = builder.build().unwrap();
            let mut state = State::new(&model);
            let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
            let mut last = 0.0;
            for _ in 0..60 {
                let report = stepper.step(&model, &mut state, &[]);
                assert_eq!((report.inverted, report.divergence), (0, None));
                // From a height of `edge` it falls at less than this.
                assert!(report.max_speed < 0.5 && report.min_volume_ratio > 0.9, "{report:?}");
                last = report.max_speed;
            }
            assert!(last < 1e-3, "{} at {edge} m: {last} m/s", model.bodies()[0].name());
        }
    }
}
