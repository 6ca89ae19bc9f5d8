//! Threads hold a body in both solvers where the oracle finds it in equilibrium.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_testing::blocks::{FRAME, GRAVITY, block, tissue};
use trocar_tissue::{
    Backend, BodyDescription, LatticeSettings, Material, Model, ModelBuilder, SolverSettings, State, Stepper, Tether,
};
use trocar_tissue_reference::{Oracle, OracleState};

/// A bar that is pinned at one end and hangs by two threads at the other.
fn hanging(backend: Backend, stiffness: f64) -> Model {
    let mesh = block([12, 3, 3], 2e-3);
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].x < 1e-4).collect();
    let end = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].x > 24e-3 - 1e-4);
    let threads: Vec<Tether> = end
        .filter(|i| mesh.vertices[*i as usize].z > 6e-3 - 1e-4)
        .take(2)
        .map(|node| Tether {
            node,
            anchor: mesh.vertices[node as usize] + DVec3::new(2e-3, 0.0, 10e-3),
            length: 11e-3,
            stiffness,
        })
        .collect();
    let mut builder = ModelBuilder::new().gravity(GRAVITY).backend(backend);
    let material = Material { viscosity: 15.0, ..tissue(3e3) };
    builder.body(BodyDescription { name: "bar".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    builder.tethers(0, &threads).unwrap();
    builder.build().unwrap()
}

/// Where the nodes come to rest (m).
fn rest(model: &Model) -> Vec<DVec3> {
    let mut state = State::new(model);
    let mut stepper = Stepper::new(model, SolverSettings::default(), FRAME, 1).unwrap();
    for _ in 0..240 {
        assert!(stepper.step(model, &mut state, &[]).divergence.is_none());
    }
    state.positions(model, 0)
}

fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

#[test]
fn a_bar_hangs_by_threads_as_in_the_oracle() {
    for stiffness in [0.5, 20.0, 2000.0] {
        let model = hanging(Backend::Tetrahedra, stiffness);
        let mut oracle = Oracle::new(&model);
        let mut equilibrium = OracleState::new(&model);
        oracle.settle(&model, &mut equilibrium, &[]).unwrap();
        let found = rest(&model);
        let (off, moved) = (
            apart(&found, equilibrium.positions(0)),
            apart(model.bodies()[0].rest_positions(), equilibrium.positions(0)),
        );
        println!("{stiffness} N/m: {:.3} mm off of {:.2} mm", 1e3 * off, 1e3 * moved);
        assert!(off < 0.02 * moved, "{stiffness} N/m: {off} m of {moved} m");
    }
}

#[test]
fn the_lattice_hangs_by_the_same_threads() {
    let lattice = Backend::Lattice(LatticeSettings { cell: 2e-3, ..LatticeSettings::default() });
    let [loose, held] = [0.0, 200.0].map(|stiffness| {
        let found = rest(&hanging(lattice, stiffness));
        found.iter().map(|p| p.z).fold(f64::INFINITY, f64::min)
    });
    let exact = rest(&hanging(Backend::Tetrahedra, 200.0)).iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    println!("lowest node: loose {loose}, held {held}, tetrahedra {exact}");
    // The bar itself is softer there.
    assert!(held > loose + 10e-3 && (held - exact).abs() < 1e-3);
}

#[test]
fn threads_of_no_surface_are_refused() {
    let mesh = block([3, 3, 3], 2e-3);
    let middle = mesh.vertices.iter().position(|p| p.distance(DVec3::splat(2e-3)) < 1e-6).unwrap() as u32;
    let mut builder = ModelBuilder::new();
    let description =
        BodyDescription { name: "cube".into(), mesh: &mesh, material: tissue(5e3), pinned: vec![0], supports: vec![] };
    builder.body(description).unwrap();
    let thread = Tether { node: middle, anchor: DVec3::ZERO, length: 0.01, stiffness: 1.0 };
    let refused = |builder: &mut ModelBuilder, index: usize, thread: Tether| {
        builder.tethers(index, &[thread]).unwrap_err().to_string()
    };
    assert!(refused(&mut builder, 0, thread).contains("free node of the surface"));
    assert!(refused(&mut builder, 0, Tether { node: 0, ..thread }).contains("free node of the surface"));
    assert!(refused(&mut builder, 1, thread).contains("body 1"));
    let stiff = Tether { node: 1, stiffness: f64::NAN, ..thread };
    assert!(refused(&mut builder, 0, stiff).contains("stiffness of NaN"));
}
