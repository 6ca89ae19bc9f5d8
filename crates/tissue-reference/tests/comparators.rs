//! Semi-implicit Euler, XPBD and Newton's method against analytic solutions and the oracle.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::{DMat3, DVec3};
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, nodes, tissue};
use trocar_tissue::{ConstitutiveModel, Divergence, Load, Material, Model, State, StepReport};
use trocar_tissue_reference::{
    Newton, Oracle, OracleState, Scheme, SemiImplicit, Xpbd, XpbdConstraints, XpbdSweep, stable_explicit_step,
};

fn run(model: &Model, scheme: Scheme, state: &mut State, frames: usize) -> StepReport {
    let mut stepper = scheme.stepper(model, FRAME, 1).unwrap();
    let mut report = StepReport::default();
    for _ in 0..frames {
        report = stepper.step(model, state, &[]);
        if report.divergence.is_some() {
            break;
        }
    }
    report
}

/// All of them fall as implicit and symplectic Euler do, g t (t + h)/2, and g t to four digits.
#[test]
fn free_fall() {
    let mesh = block([2, 2, 2], 2e-3);
    for constitutive in ConstitutiveModel::ALL {
        let material = Material { model: constitutive, viscosity: 4.0, ..tissue(12e3) };
        let model = model(&mesh, material, vec![], GRAVITY);
        for scheme in [
            Scheme::SemiImplicit(SemiImplicit { substeps: 400 }),
            Scheme::Xpbd(Xpbd::default()),
            Scheme::Newton(Newton { substeps: 8 }),
        ] {
            let mut state = State::new(&model);
            assert_eq!(run(&model, scheme, &mut state, 60).divergence, None);
            let nodes = mesh.vertices.len();
            let drop: f64 = (0..nodes).map(|i| (state.position(&model, 0, i) - mesh.vertices[i]).z).sum();
            let speed: f64 = (0..nodes).map(|i| state.velocity(&model, 0, i).z).sum();
            let expected = GRAVITY.z * (1.0 + FRAME / scheme.substeps() as f64) / 2.0;
            assert!((drop / nodes as f64 / expected - 1.0).abs() < 1e-4, "{constitutive:?} {scheme:?}: {drop}");
            assert!((speed / nodes as f64 / GRAVITY.z - 1.0).abs() < 1e-4, "{constitutive:?} {scheme:?}: {speed}");
        }
    }
}

/// A spinning, stretched free body keeps both its momenta, with dashpots and without.
#[test]
fn momenta_are_kept() {
    let mesh = block([2, 2, 4], 2e-3);
    let centre = DVec3::new(2e-3, 2e-3, 4e-3);
    let (spin, drift) = (DVec3::new(3.0, 0.0, 6.0), DVec3::new(0.01, 0.02, 0.0));
    for viscosity in [0.0, 4.0] {
        let model = model(&mesh, Material { viscosity, ..tissue(12e3) }, vec![], DVec3::ZERO);
        let momenta = |state: &State| {
            let of = |i: usize| {
                let p = model.bodies()[0].mass(i) * state.velocity(&model, 0, i);
                (p, (state.position(&model, 0, i) - centre).cross(p))
            };
            let all = (0..mesh.vertices.len()).map(of);
            all.fold((DVec3::ZERO, DVec3::ZERO), |sum, one| (sum.0 + one.0, sum.1 + one.1))
        };
        for scheme in [
            Scheme::SemiImplicit(SemiImplicit { substeps: 400 }),
            Scheme::Xpbd(Xpbd::default()),
            Scheme::Xpbd(Xpbd { sweep: XpbdSweep::Jacobi { relaxation: 0.1 }, ..Xpbd::default() }),
        ] {
            let mut state = State::new(&model);
            for (node, p) in mesh.vertices.iter().enumerate() {
                let stretch = DVec3::Z * 0.1 * (p.z - centre.z).signum();
                state.set_velocity(&model, 0, node, drift + stretch + spin.cross(*p - centre));
            }
            let before = momenta(&state);
            assert_eq!(run(&model, scheme, &mut state, 6).divergence, None, "{scheme:?}");
            let after = momenta(&state);
            // One vertex' mass at a tenth of a metre a second is 5e-6 kg m/s; the state is rounded
            // to f32 between frames.
            assert!((after.0 - before.0).length() < 1e-5 * before.0.length(), "{scheme:?}: {before:?} {after:?}");
            // XPBD's pushes have no moment about where the vertices were, but a small one about
            // where they end.
            let tolerance = if matches!(scheme, Scheme::Xpbd(_)) { 0.05 } else { 1e-4 };
            assert!((after.1 - before.1).length() < tolerance * before.1.length(), "{scheme:?}: {before:?} {after:?}");
        }
    }
}

/// With short enough steps XPBD's and semi-implicit Euler's column stands as the theory says (nu =
/// 0), rho g L^2/(2E) lower at its top.
#[test]
fn a_column_sags_under_its_weight() {
    let mesh = block([2, 2, 6], 2e-3);
    let length = 12e-3;
    let material = Material { poisson_ratio: 0.0, viscosity: 4.0, ..tissue(12e3) };
    let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let top = nodes(&mesh, |p| (p.z - length).abs() < 1e-9);
    let expected = 1200.0 * 9.81 * length * length / (2.0 * 12e3);
    for (scheme, tolerance) in [
        (Scheme::Xpbd(Xpbd { substeps: 400, ..Xpbd::default() }), 0.03),
        (Scheme::SemiImplicit(SemiImplicit::stable(&model, FRAME)), 0.02),
        (Scheme::Newton(Newton { substeps: 1 }), 0.02),
    ] {
        let mut state = State::new(&model);
        let report = run(&model, scheme, &mut state, 90);
        assert!(report.max_speed < 1e-3, "{scheme:?}: {} m/s", report.max_speed);
        let sag = length - state.centroid(&model, 0, &top).z;
        assert!((sag / expected - 1.0).abs() < tolerance, "{scheme:?}: {:.5} mm for {:.5}", sag * 1e3, expected * 1e3);
    }
}

/// Newton's law for XPBD (the engine's) has no shear stiffness at small strains: the same column
/// sags far more.
#[test]
fn strain_traces_do_not_hold_a_column() {
    let mesh = block([2, 2, 6], 2e-3);
    let model = model(&mesh, Material { viscosity: 4.0, ..tissue(12e3) }, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let top = nodes(&mesh, |p| (p.z - 12e-3).abs() < 1e-9);
    let sag = |constraints| {
        let mut state = State::new(&model);
        run(&model, Scheme::Xpbd(Xpbd { substeps: 400, constraints, ..Xpbd::default() }), &mut state, 60);
        12e-3 - state.centroid(&model, 0, &top).z
    };
    let (material, traces) = (sag(XpbdConstraints::NeoHookean), sag(XpbdConstraints::StrainTrace));
    assert!(traces > 5.0 * material, "{:.4} mm and {:.4} mm", traces * 1e3, material * 1e3);
}

/// Below its stable step semi-implicit Euler's energy stays where it was; above, the body reaches
/// the speed limit, and says so.
#[test]
fn the_stable_step_is_where_it_is_said_to_be() {
    let mesh = block([3, 3, 3], 2e-3);
    let model = model(&mesh, tissue(12e3), nodes(&mesh, |p| p.z == 0.0), DVec3::ZERO);
    let step = stable_explicit_step(&model);
    let limit = FRAME / step;
    let start = || {
        let mut state = State::new(&model);
        for node in 0..mesh.vertices.len() {
            state.set_velocity(&model, 0, node, DVec3::new(0.0, 1e-3, 2e-3) * mesh.vertices[node].z / 6e-3);
        }
        state
    };
    let law = tissue(12e3).hyperelastic();
    let energy = |state: &State| {
        let x = state.positions(&model, 0);
        let edges = |x: &[DVec3], t: &[u32; 4]| {
            let [a, b, c, d] = t.map(|i| x[i as usize]);
            DMat3::from_cols(b - a, c - a, d - a)
        };
        let stored = mesh.tets.iter().map(|t| {
            let rest = edges(&mesh.vertices, t);
            law.energy(edges(&x, t) * rest.inverse()) * rest.determinant() / 6.0
        });
        state.kinetic_energy(&model) + stored.sum::<f64>()
    };
    let mut state = start();
    let first = energy(&state);
    let stable = SemiImplicit { substeps: (1.1 * limit).ceil() as usize };
    assert_eq!(run(&model, Scheme::SemiImplicit(stable), &mut state, 60).divergence, None);
    let last = energy(&state);
    assert!((last / first - 1.0).abs() < 0.1, "{first:.3e} J became {last:.3e} J");

    let mut state = start();
    let long = SemiImplicit { substeps: (0.9 * limit).floor() as usize };
    let report = run(&model, Scheme::SemiImplicit(long), &mut state, 60);
    assert_eq!(report.divergence, Some(Divergence::OverSpeed { body: 0 }), "limit {step:.3e} s");
}

/// Many iterations of XPBD a substep come to implicit Euler's.
#[test]
fn converged_xpbd_is_implicit_euler() {
    let mesh = block([2, 2, 3], 2e-3);
    let foot = nodes(&mesh, |p| p.z == 0.0);
    let model = model(&mesh, tissue(12e3), foot, GRAVITY);
    let (mut state, mut newton) = (State::new(&model), State::new(&model));
    let mut truth = OracleState::new(&model);
    let mut oracle = Oracle::new(&model);
    for _ in 0..96 {
        oracle.step(&model, &mut truth, FRAME / 32.0, &[]).unwrap();
    }
    let xpbd = Xpbd { substeps: 32, iterations: 100, constraints: XpbdConstraints::Strains, ..Xpbd::default() };
    run(&model, Scheme::Xpbd(xpbd), &mut state, 3);
    run(&model, Scheme::Newton(Newton { substeps: 32 }), &mut newton, 3);
    let largest = |of: &dyn Fn(usize) -> f64| (0..mesh.vertices.len()).map(of).fold(0.0, f64::max);
    let moved = largest(&|i| (truth.positions(0)[i] - mesh.vertices[i]).length());
    let off = largest(&|i| (state.position(&model, 0, i) - truth.positions(0)[i]).length());
    let newton_off = largest(&|i| (newton.position(&model, 0, i) - truth.positions(0)[i]).length());
    assert!(off < 0.01 * moved, "off by {off:.2e} m of {moved:.2e}");
    // f32 between frames.
    assert!(newton_off < 1e-4 * moved, "off by {newton_off:.2e} m of {moved:.2e}");
}

/// A free block whose nodes are pushed by their mass times an acceleration has that acceleration.
#[test]
fn a_load_accelerates() {
    let mesh = block([2, 2, 2], 2e-3);
    let model = model(&mesh, tissue(12e3), vec![], DVec3::ZERO);
    let acceleration = DVec3::new(0.3, -0.2, 0.5);
    let body = &model.bodies()[0];
    let load = |node: usize| Load { body: 0, node, force: body.mass(node) * acceleration };
    let loads: Vec<Load> = (0..body.len()).map(load).collect();
    for scheme in [
        Scheme::Newton(Newton { substeps: 2 }),
        Scheme::SemiImplicit(SemiImplicit::stable(&model, FRAME)),
        Scheme::Xpbd(Xpbd::default()),
    ] {
        let mut state = State::new(&model);
        let mut stepper = scheme.stepper(&model, FRAME, 1).unwrap();
        for _ in 0..30 {
            assert_eq!(stepper.step_with_loads(&model, &mut state, &[], &loads).divergence, None);
        }
        for node in 0..body.len() {
            let off = state.velocity(&model, 0, node) - 0.5 * acceleration;
            assert!(off.length() < 1e-4, "{scheme:?}: node {node} is {off} m/s off after half a second");
        }
    }
}
