//! A block that hangs from a wall, against scikit-fem on the same mesh (`oracles/skfem_block.py`
//! makes the fixture).

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_testing::blocks::{self, GRAVITY, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, MassFloor, Material, Model, ModelBuilder, SolverSettings, State, Stepper,
};
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::statics::{Elements, Loading};
use trocar_tissue_reference::{Oracle, OracleState};

/// The fixture's displacements (m) of one solution.
fn solution(name: &str) -> Vec<DVec3> {
    let lines = include_str!("fixtures/skfem_block.txt").lines().skip_while(|line| *line != name).skip(1);
    let vector = |line: &str| -> Option<DVec3> {
        let numbers: Vec<f64> = line.split(' ').map_while(|x| x.parse().ok()).collect();
        <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array)
    };
    lines.map_while(vector).collect()
}

fn hanging(constitutive: ConstitutiveModel, gravity: DVec3) -> Model {
    let mesh = block([5, 4, 4], 3e-3);
    let mut builder = ModelBuilder::new().gravity(gravity).mass_floor(MassFloor::None);
    let material = Material { model: constitutive, ..tissue(12e3) };
    let pinned = nodes(&mesh, |p| p.x == 0.0);
    builder.body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    builder.build().unwrap()
}

/// Largest distance of displacements from the reference, over the largest displacement.
fn off(model: &Model, positions: &[DVec3], reference: &[DVec3]) -> f64 {
    let rest = model.bodies()[0].rest_positions();
    assert_eq!(reference.len(), rest.len());
    let largest = |of: &dyn Fn(usize) -> f64| (0..rest.len()).map(of).fold(0.0, f64::max);
    largest(&|i| (positions[i] - rest[i] - reference[i]).length()) / largest(&|i| reference[i].length())
}

#[test]
fn the_oracle_sags_as_scikit_fem() {
    use ConstitutiveModel::{Corotated, StVenantKirchhoff, StableNeoHookean};
    for (name, constitutive, share, most) in [
        ("stable-neo-hookean", StableNeoHookean, 1.0, 1e-6),
        ("st-venant-kirchhoff", StVenantKirchhoff, 1.0, 1e-6),
        // Small loads: Hooke's law, up to the strain itself.
        ("linear", StableNeoHookean, 1e-4, 1e-4),
        ("linear", StVenantKirchhoff, 1e-4, 1e-4),
        ("linear", Corotated, 1e-4, 1e-4),
    ] {
        let model = hanging(constitutive, share * GRAVITY);
        let mut state = OracleState::new(&model);
        let precision = Precision { gradient: 1e-9 * share, ..Precision::default() };
        Oracle::with_precision(&model, precision).settle(&model, &mut state, &[]).unwrap();
        let off = off(&model, state.positions(0), &solution(name));
        println!("{constitutive:?} under {share} g: {off:.1e} from scikit-fem's");
        assert!(off < most, "{constitutive:?}, {name}: {off:.1e}");
    }
}

/// The default solver at rest is there too, within the tolerance of the test.
#[test]
fn the_default_schedule_sags_as_scikit_fem() {
    let model = hanging(ConstitutiveModel::StableNeoHookean, GRAVITY);
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), blocks::FRAME, 1).unwrap();
    for _ in 0..40 {
        for _ in 0..15 {
            stepper.step(&model, &mut state, &[]);
        }
        state.stop();
    }
    let off = off(&model, &state.positions(&model, 0), &solution("stable-neo-hookean"));
    println!("the default schedule: {off:.1e} from scikit-fem's");
    assert!(off < 1e-3, "{off:.1e}");
}

/// Quadratic tetrahedra, and linear ones by the same Newton's method, are scikit-fem's.
#[test]
fn elements_of_either_order_sag_as_scikit_fem() {
    let mesh = block([5, 4, 4], 3e-3);
    let material = tissue(12e3);
    for (name, quadratic, share, most) in [
        ("stable-neo-hookean", false, 1.0, 1e-6),
        ("quadratic-linear", true, 1e-4, 1e-4),
        ("quadratic-stable-neo-hookean", true, 1.0, 1e-6),
    ] {
        let elements = if quadratic { Elements::quadratic(&mesh, material) } else { Elements::linear(&mesh, material) };
        let held = elements.held_by(|p| p.x == 0.0);
        let loading = Loading { body_force: share * material.density * GRAVITY, ..Loading::default() };
        let precision = Precision { gradient: 1e-9 * share, ..Precision::default() };
        let found = elements.settle(&held, &loading, 4, precision).unwrap();
        let reference = solution(name);
        let largest = |of: &dyn Fn(usize) -> f64| (0..reference.len()).map(of).fold(0.0, f64::max);
        let off = largest(&|i| (found.displacements[i] - reference[i]).length()) / largest(&|i| reference[i].length());
        println!("{name}: {off:.1e} from scikit-fem's after {} steps", found.iterations);
        assert_eq!(reference.len(), mesh.vertices.len());
        assert!(off < most, "{name}: {off:.1e}");
        let weight = share * material.density * mesh.volume() * GRAVITY;
        let carried = found.reactions.iter().sum::<DVec3>();
        assert!((carried + weight).length() < 1e-6 * weight.length(), "the pins carry {carried}, not {weight}");
    }
}
