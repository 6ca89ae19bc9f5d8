//! Motion against analytic solutions.

use glam::DVec3;
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, nodes, tissue};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Descent, Material, ModelBuilder, QuasiNewton, SolverSettings, Start, State,
    Stepper, SupportPlane,
};

/// Free fall matches g t^2/2 and g t to four digits, with damping, in all materials; the
/// paper's schedule follows implicit Euler's own law g t (t + h)/2.
#[test]
fn free_fall() {
    let mesh = block([3, 3, 3], 2e-3);
    for constitutive in ConstitutiveModel::ALL {
        let material = Material { model: constitutive, viscosity: 4.0, ..tissue(12e3) };
        let model = model(&mesh, material, vec![], GRAVITY);
        for (schedule, h) in [(SolverSettings::default(), 0.0), (SolverSettings::PAPER, FRAME / 8.0)] {
            let mut state = State::new(&model);
            let mut stepper = Stepper::new(&model, schedule, FRAME, 1).unwrap();
            for _ in 0..60 {
                assert_eq!(stepper.step(&model, &mut state, &[]).divergence, None);
            }
            let fall = |i: usize| (state.position(&model, 0, i) - mesh.vertices[i]).z;
            let speed = |i: usize| state.velocity(&model, 0, i).z;
            let mean = |of: &dyn Fn(usize) -> f64| (0..64).map(of).sum::<f64>() / 64.0;
            let expected = GRAVITY.z * (1.0 + h) / 2.0;
            let drop = mean(&fall);
            assert!((drop / expected - 1.0).abs() < 1e-4, "{constitutive:?} {schedule:?}: {drop} for {expected}");
            let speed = mean(&speed);
            assert!((speed / GRAVITY.z - 1.0).abs() < 1e-4, "{constitutive:?} {schedule:?}: {speed} m/s");
        }
    }
}

/// A column that stands on its pinned foot sags by rho g L^2/(2E) at its top (nu = 0: no foot
/// effect).
#[test]
fn a_column_sags_under_its_weight() {
    let (cells, edge) = ([4, 4, 10], 2e-3);
    let mesh = block(cells, edge);
    let material = Material { poisson_ratio: 0.0, viscosity: 4.0, ..tissue(12e3) };
    let model = model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 0).unwrap();
    let mut report = Default::default();
    for _ in 0..180 {
        report = stepper.step(&model, &mut state, &[]);
    }
    assert!(report.max_speed < 1e-4, "it has not come to rest: {} m/s", report.max_speed);
    let length = 0.02;
    let top = nodes(&mesh, |p| (p.z - length).abs() < 1e-9);
    let sag = length - state.centroid(&model, 0, &top).z;
    let expected = 1200.0 * 9.81 * length * length / (2.0 * 12e3);
    // Linear elements and finite strain: 1% of sag over length each.
    assert!((sag / expected - 1.0).abs() < 0.02, "sags {:.4} mm, expected {:.4} mm", sag * 1e3, expected * 1e3);
}

/// A beam bends as far in substeps of 0.3 ms as in those of 8 ms: in short ones, what rounding
/// leaves of a force is not taken for rest.
#[test]
fn a_beam_bends_as_far_in_short_substeps() {
    let mesh = block([10, 3, 3], 1e-2);
    let material = Material { viscosity: 2e3, ..tissue(300e3) };
    let model = model(&mesh, material, nodes(&mesh, |p| p.x == 0.0), GRAVITY);
    let end = nodes(&mesh, |p| (p.x - 0.1).abs() < 1e-9);
    let [long, short] = [2, 54].map(|substeps| {
        let settings = QuasiNewton { substeps, iterations: 40, memory: 8, tolerance: 3e-8, relative: 1e-2 };
        let mut stepper = Stepper::new(&model, SolverSettings::QuasiNewton(settings), FRAME, 1).unwrap();
        let mut state = State::new(&model);
        for _ in 0..60 {
            assert_eq!(stepper.step(&model, &mut state, &[]).divergence, None);
        }
        0.015 - state.centroid(&model, 0, &end).z
    });
    assert!(
        (short / long - 1.0).abs() < 2e-3,
        "{:.4} mm in short substeps, {:.4} mm in long ones",
        1e3 * short,
        1e3 * long
    );
}

/// A spinning free body keeps its angular momentum as well with dashpots as without.
#[test]
fn dashpots_do_not_brake_rotation() {
    let mesh = block([4, 4, 4], 2e-3);
    let centre = DVec3::splat(4e-3);
    let spin = DVec3::new(0.0, 0.0, 4.0);
    let mut kept = Vec::new();
    for viscosity in [0.0, 4.0] {
        let model = model(&mesh, Material { viscosity, ..tissue(12e3) }, vec![], DVec3::ZERO);
        let mut state = State::new(&model);
        for (node, p) in mesh.vertices.iter().enumerate() {
            state.set_velocity(&model, 0, node, spin.cross(p - centre));
        }
        let momentum = |state: &State| -> f64 {
            (0..mesh.vertices.len())
                .map(|i| {
                    let arm = state.position(&model, 0, i) - centre;
                    model.bodies()[0].mass(i) * arm.cross(state.velocity(&model, 0, i)).z
                })
                .sum()
        };
        let before = momentum(&state);
        let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 1).unwrap();
        for _ in 0..30 {
            stepper.step(&model, &mut state, &[]);
        }
        kept.push(momentum(&state) / before);
    }
    assert!((kept[0] - kept[1]).abs() < 0.02, "kept {:.4} without and {:.4} with dashpots", kept[0], kept[1]);
    assert!(kept[0] > 0.9, "kept {}", kept[0]);
}

/// A block dropped on the plane comes to rest on it; one pushed along it is stopped by friction
/// after about v^2/(2 mu g).
#[test]
fn the_plane_supports_and_holds() {
    let mesh = block([4, 4, 2], 3e-3);
    let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction: 0.6 };
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let material = Material { viscosity: 4.0, ..tissue(30e3) };
    builder
        .body(BodyDescription {
            name: "block".into(),
            mesh: &mesh,
            material,
            pinned: vec![],
            supports: vec![plane.into()],
        })
        .unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    // Ten sweeps do not carry the friction of the foot through the block, which then slides several
    // times too far; the law itself is tested with enough of them.
    let schedule = SolverSettings::Descent(Descent { substeps: 8, iterations: 150, start: Start::Adaptive });
    let mut stepper = Stepper::new(&model, schedule, FRAME, 0).unwrap();
    let all: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let mut report = Default::default();
    for _ in 0..90 {
        report = stepper.step(&model, &mut state, &[]);
    }
    assert!(report.max_speed < 0.01, "{} m/s", report.max_speed);
    let deepest = state.positions(&model, 0).iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    assert!((-2e-4..0.0).contains(&deepest), "{deepest} m");

    let from = state.centroid(&model, 0, &all);
    let speed = 0.3;
    for node in 0..mesh.vertices.len() {
        state.set_velocity(&model, 0, node, DVec3::X * speed);
    }
    for _ in 0..60 {
        report = stepper.step(&model, &mut state, &[]);
    }
    let slid = (state.centroid(&model, 0, &all) - from).x;
    let expected = speed * speed / (2.0 * 0.6 * 9.81);
    assert!(report.max_speed < 0.02, "{} m/s", report.max_speed);
    assert!((slid / expected - 1.0).abs() < 0.25, "slid {:.2} mm, expected {:.2} mm", slid * 1e3, expected * 1e3);
}
