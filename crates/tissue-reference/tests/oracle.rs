//! The oracle against analytic solutions, and the stepper against the oracle.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, nodes, tissue};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Descent, Grasp, Material, Model, ModelBuilder, SolverSettings, Start, State,
    Stepper, SupportPlane, ToolMotion,
};
use trocar_tissue_reference::oracle::{Failure, Precision};
use trocar_tissue_reference::{Error, Held, Oracle, OracleState};

const SUBSTEP: f64 = FRAME / 8.0;

/// Root mean square of the distances.
fn rms(a: &[DVec3], b: &[DVec3]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum / a.len() as f64).sqrt()
}

fn settled(model: &Model) -> OracleState {
    let mut state = OracleState::new(model);
    Oracle::new(model).settle(model, &mut state, &[]).unwrap();
    state
}

/// Mean over the area of the face at z = `top`.
fn mean_height_of_the_top(mesh: &TetMesh, x: &[DVec3], top: f64) -> f64 {
    let (mut sum, mut faces) = (0.0, 0.0);
    for tet in &mesh.tets {
        let face: Vec<usize> =
            tet.iter().map(|i| *i as usize).filter(|i| (mesh.vertices[*i].z - top).abs() < 1e-9).collect();
        if face.len() == 3 {
            // All faces are as large.
            sum += face.iter().map(|i| x[*i].z).sum::<f64>() / 3.0;
            faces += 1.0;
        }
    }
    sum / faces
}

/// A column that stands on its foot sags by rho g L^2/(2E) at its top (nu = 0). Raised masses add
/// up to a percent to its weight; with the model's own masses the sag is sum m g z/(E A), which
/// linear elements reproduce exactly.
#[test]
fn a_column_sags_by_its_weight() {
    let (length, section, young_modulus) = (0.02, 64e-6, 12e6);
    for constitutive in ConstitutiveModel::ALL {
        for n in [2, 4, 8] {
            let mesh = block([n, n, 5 * n / 2], 8e-3 / n as f64);
            // Stiff: finite strain is 1e-5 of it.
            let material = Material { model: constitutive, poisson_ratio: 0.0, ..tissue(young_modulus) };
            let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
            let state = settled(&model);
            let height = mean_height_of_the_top(&mesh, state.positions(0), length);
            let moment: f64 = (0..mesh.vertices.len()).map(|i| model.bodies()[0].mass(i) * mesh.vertices[i].z).sum();
            let off = (length - height) / (9.81 * moment / (young_modulus * section)) - 1.0;
            let off_column = (length - height) / (1200.0 * 9.81 * length * length / (2.0 * young_modulus)) - 1.0;
            println!("{constitutive:?}: {n} cells wide, sag off by {off:.1e}, from the column's by {off_column:.1e}");
            assert!(off.abs() < 1e-4 && off_column.abs() < 0.01, "{constitutive:?}, {n}: {off}, {off_column}");
        }
    }
}

/// Implicit Euler's own law: g h^2 n (n + 1)/2 after n steps, to rounding.
#[test]
fn free_fall_is_exact() {
    let mesh = block([2, 2, 2], 2e-3);
    for constitutive in ConstitutiveModel::ALL {
        let material = Material { model: constitutive, viscosity: 4.0, ..tissue(12e3) };
        let model = model(&mesh, material, vec![], GRAVITY);
        let (mut oracle, mut state) = (Oracle::new(&model), OracleState::new(&model));
        for _ in 0..48 {
            oracle.step(&model, &mut state, SUBSTEP, &[]).unwrap();
        }
        let expected = GRAVITY * SUBSTEP * SUBSTEP * 48.0 * 49.0 / 2.0;
        for (x, rest) in state.positions(0).iter().zip(&mesh.vertices) {
            assert!((*x - *rest - expected).length() < 1e-9 * expected.length(), "{constitutive:?}");
        }
        assert!((state.time - 0.1).abs() < 1e-12);
    }
}

/// A pinned block in motion, pressed to a rough plane and held at a corner.
fn busy(constitutive: ConstitutiveModel, viscosity: f64, friction: f64, mesh: &TetMesh) -> (Model, State) {
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let material = Material { model: constitutive, viscosity, ..tissue(12e3) };
    let plane = SupportPlane { point: DVec3::Z * 0.2e-3, normal: DVec3::Z, friction };
    let pinned = nodes(mesh, |p| p.x == 0.0);
    builder
        .body(BodyDescription { name: "busy".into(), mesh, material, pinned, supports: vec![plane.into()] })
        .unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    for (i, p) in mesh.vertices.iter().enumerate() {
        state.set_velocity(&model, 0, i, DVec3::new(0.02, 6.0 * p.x, 5.0 * p.y - 0.03));
    }
    for i in nodes(mesh, |p| p.x == 0.0) {
        state.set_velocity(&model, 0, i as usize, DVec3::ZERO);
    }
    (model, state)
}

/// The stepper and the oracle minimise the same function: with sweeps enough they agree to the
/// rounding of `f32`, in every material, with dashpots, a rough plane and a grasp.
#[test]
fn sweeps_converge_to_the_oracles_step() {
    let mesh = block([6, 3, 3], 2e-3);
    for constitutive in ConstitutiveModel::ALL {
        let (model, start) = busy(constitutive, 60.0, 0.2, &mesh);
        let held = nodes(&mesh, |p| p.x > 11e-3 && p.z > 5e-3);
        let grasp = Grasp::capture(&model, &start, 0, &held, 0, &Pose::IDENTITY);
        let to = Pose { translation: DVec3::new(-1e-5, 0.0, 3e-5), ..Pose::IDENTITY };
        let exact = |model: &Model| {
            let mut exact = OracleState::from_state(model, &start);
            let solutions = Oracle::new(model).step(model, &mut exact, SUBSTEP, &Held::by(&grasp, &to)).unwrap();
            println!("{constitutive:?}: {solutions:?}");
            exact
        };
        let oracle = exact(&model);
        let moved = rms(oracle.positions(0), &start.positions(&model, 0));
        let mut off = Vec::new();
        for iterations in [10, 40, 150, 600] {
            let schedule = SolverSettings::Descent(Descent { substeps: 1, iterations, start: Start::Inertial });
            let mut state = start.clone();
            state.grasps = vec![grasp.clone()];
            let motion = ToolMotion { from: Pose::IDENTITY, to };
            let report = Stepper::new(&model, schedule, SUBSTEP, 1).unwrap().step(&model, &mut state, &[motion]);
            assert_eq!((report.divergence, report.grasp_limited), (None, 0));
            off.push(rms(oracle.positions(0), &state.positions(&model, 0)) / moved);
        }
        println!("{constitutive:?}: after 10, 40, 150, 600 sweeps {off:?} of the step of {moved:.2e} m");
        assert!(off[2] < 1e-3 && off[3] < 3e-5, "{constitutive:?}: {off:?}");
        // Each part of the function matters more than that.
        for (viscosity, friction) in [(50.0, 0.2), (60.0, 0.15)] {
            let other = exact(&busy(constitutive, viscosity, friction, &mesh).0);
            let change = rms(other.positions(0), oracle.positions(0)) / moved;
            assert!(change > 2.0 * off[3], "{constitutive:?}, {viscosity} Pa s, friction {friction}: {change:.2e}");
        }
    }
}

#[test]
fn statics_are_where_steps_come_to_rest() {
    let mesh = block([5, 2, 2], 2e-3);
    for constitutive in ConstitutiveModel::ALL {
        let material = Material { model: constitutive, viscosity: 4.0, ..tissue(12e3) };
        let model = model(&mesh, material, nodes(&mesh, |p| p.x == 0.0), GRAVITY);
        let rest = settled(&model);
        let (mut oracle, mut state) = (Oracle::new(&model), OracleState::new(&model));
        for _ in 0..300 {
            oracle.step(&model, &mut state, FRAME, &[]).unwrap();
        }
        let sag = rms(rest.positions(0), &mesh.vertices);
        let off = rms(rest.positions(0), state.positions(0)) / sag;
        println!("{constitutive:?}: sags {:.3} mm; steps come to {off:.1e} of it", sag * 1e3);
        assert!(sag > 1e-4 && off < 1e-6, "{constitutive:?}: {off:.2e} of {sag} m");
    }
}

/// What the default schedule's adaptive start is for: it comes to rest where the energy is least.
#[test]
fn the_default_schedule_sags_to_the_equilibrium() {
    let mesh = block([4, 4, 8], 2e-3);
    let material = Material { viscosity: 4.0, ..tissue(12e3) };
    let model = model(&mesh, material, nodes(&mesh, |p| p.z < 6e-3), GRAVITY);
    let rest = settled(&model);
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 0).unwrap();
    for _ in 0..120 {
        stepper.step(&model, &mut state, &[]);
    }
    let sag = rms(rest.positions(0), &mesh.vertices);
    let off = rms(rest.positions(0), &state.positions(&model, 0)) / sag;
    println!("sag of {:.4} mm, the default schedule is off by {off:.1e} of it", sag * 1e3);
    assert!(off < 0.01, "{off}");
}

#[test]
fn the_same_bits_twice() {
    let mesh = block([6, 3, 3], 2e-3);
    let run = || {
        let (model, start) = busy(ConstitutiveModel::Corotated, 60.0, 0.6, &mesh);
        let (mut oracle, mut state) = (Oracle::new(&model), OracleState::from_state(&model, &start));
        for _ in 0..5 {
            oracle.step(&model, &mut state, SUBSTEP, &[]).unwrap();
        }
        state
    };
    let (a, b) = (run(), run());
    let bits = |s: &OracleState| -> Vec<[u64; 3]> {
        s.positions(0).iter().chain(s.velocities(0)).map(|p| p.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(bits(&a), bits(&b));
}

/// Large motions of held nodes are taken in parts; those that no tissue can follow are refused, and
/// nothing is changed then.
#[test]
fn held_nodes_go_far_or_are_refused() {
    let mesh = block([3, 3, 5], 2e-3);
    for constitutive in [ConstitutiveModel::StableNeoHookean, ConstitutiveModel::Corotated] {
        let model = model(&mesh, tissue(12e3), nodes(&mesh, |p| p.z == 0.0), GRAVITY);
        let hold = |height: f64| -> Vec<Held> {
            let top = nodes(&mesh, |p| p.z > 9e-3);
            let target = |i: u32| mesh.vertices[i as usize] + DVec3::Z * height;
            top.into_iter().map(|node| Held { body: 0, node, target: target(node) }).collect()
        };
        for height in [-4e-3, 10e-3] {
            let (mut oracle, mut state) = (Oracle::new(&model), OracleState::new(&model));
            let solution = oracle.settle(&model, &mut state, &hold(height)).unwrap();
            println!("{constitutive:?} {height} m: {solution:?}");
            for h in hold(height) {
                assert_eq!(state.positions(0)[h.node as usize], h.target);
            }
        }
        let (mut oracle, mut state) = (Oracle::new(&model), OracleState::new(&model));
        let before = state.clone();
        let mirrored: Vec<Held> = (0..mesh.vertices.len() as u32)
            .map(|node| Held { body: 0, node, target: mesh.vertices[node as usize] * DVec3::new(1.0, 1.0, -1.0) })
            .collect();
        let refused = oracle.step(&model, &mut state, SUBSTEP, &mirrored);
        let unreachable = matches!(refused, Err(Error::Unsolved { failure: Failure::Unreachable { .. }, .. }));
        assert!(unreachable, "{refused:?}");
        assert_eq!(state, before);
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let mesh = block([2, 2, 2], 2e-3);
    let free = model(&mesh, tissue(12e3), vec![], GRAVITY);
    let (mut oracle, mut fresh) = (Oracle::new(&free), OracleState::new(&free));
    let mut state = fresh.clone();
    let failure = |result: Result<_, Error>| match result {
        Err(Error::Unsolved { failure, .. }) => failure,
        other => panic!("{other:?}"),
    };
    assert_eq!(failure(oracle.settle(&free, &mut state, &[]).map(drop)), Failure::Unheld);
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(oracle.step(&free, &mut state, dt, &[]).is_err());
    }
    let held = |body, node, z| Held { body, node, target: DVec3::Z * z };
    for bad in [held(1, 0, 0.0), held(0, 27, 0.0), held(0, 0, f64::NAN)] {
        assert!(oracle.step(&free, &mut state, SUBSTEP, &[bad]).is_err());
    }
    assert_eq!(state, fresh);
    state.positions_mut(0)[13] = DVec3::splat(9e-3);
    assert!(matches!(failure(oracle.step(&free, &mut state, SUBSTEP, &[]).map(drop)), Failure::Inverted { .. }));
    state.positions_mut(0)[13].x = f64::INFINITY;
    assert!(oracle.step(&free, &mut state, SUBSTEP, &[]).is_err());
    let other = model(&block([3, 2, 2], 2e-3), tissue(12e3), vec![], GRAVITY);
    assert!(oracle.step(&other, &mut fresh, SUBSTEP, &[]).is_err());
    assert!(oracle.step(&other, &mut OracleState::new(&other), SUBSTEP, &[]).is_err());
    // Too few iterations are never success.
    let pinned = model(&mesh, tissue(12e3), vec![0, 1, 2], GRAVITY);
    let mut hasty = Oracle::with_precision(&pinned, Precision { iterations: 1, ..Precision::default() });
    let result = hasty.settle(&pinned, &mut OracleState::new(&pinned), &[]).map(drop);
    assert!(matches!(failure(result), Failure::NotConverged { iterations: 1, .. }));
}
