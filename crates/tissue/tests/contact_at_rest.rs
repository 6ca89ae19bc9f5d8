//! What presses on tissue comes to rest, and stays there.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_tissue::{
    Backend, BodyContact, BodyDescription, Collider, LatticeSettings, Material, ModelBuilder, Shape, SolverSettings,
    State, Stepper, ToolContact, ToolMotion,
};

/// Frames in which the sphere goes down, and in which it stays there.
const DOWN: u32 = 30;
const REST: u32 = 30;

/// A sphere is pressed on triangles that are a third of its radius, off their corners: it touches
/// some fifteen edges and triangles. Points of contact that follow the tissue a substep late swing
/// from side to side.
#[test]
fn a_sphere_on_many_triangles_comes_to_rest() {
    let (thickness, radius, depth) = (8e-3, 4e-3, 1.2e-3);
    let edge = thickness / 6.0;
    let mesh = block([18, 18, 6], edge);
    let material = Material { viscosity: 20.0, poisson_ratio: 0.3, ..tissue(5e3) };
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    let mut builder = ModelBuilder::new().gravity(DVec3::ZERO).tool_contact(ToolContact::Surface);
    builder.body(BodyDescription { name: "layer".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let shape = Shape::Sphere { centre: edge * DVec3::new(9.08, 8.9, 0.0), radius };
    builder.collider(Collider { name: "tool".into(), tool: 0, shape, rest_offset: 0.0, friction: 0.0 }).unwrap();
    let model = builder.build().unwrap();
    let place = |frame: u32| {
        let share = f64::from(frame.min(DOWN)) / f64::from(DOWN);
        Pose { translation: DVec3::Z * (thickness + radius - depth * share), ..Pose::IDENTITY }
    };
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
    for k in 0..DOWN + REST {
        let report = stepper.step(&model, &mut state, &[ToolMotion { from: place(k), to: place(k + 1) }]);
        assert!(report.divergence.is_none() && report.inverted == 0, "{report:?}");
    }
    let fastest = (0..mesh.vertices.len()).map(|i| state.velocity(&model, 0, i).length()).fold(0.0, f64::max);
    assert!(stepper.forces()[0].touching > 10, "{:?}", stepper.forces()[0]);
    assert!(fastest < 1e-4, "{:.3} mm/s", 1e3 * fastest);
}

/// Tissue lies on tissue, where friction bears some of its weight. Once it is at rest it has the
/// same bits in every frame. Friction that is rounded anew in each of them would load it until it
/// moves, and again.
#[test]
fn tissue_on_tissue_stays_at_rest() {
    let mesh = block([4, 4, 3], 4e-3);
    let upper = TetMesh {
        vertices: mesh.vertices.iter().map(|p| *p + DVec3::new(1.3e-3, 0.9e-3, 12.2e-3)).collect(),
        ..mesh.clone()
    };
    let material = Material { viscosity: 72.0, ..tissue(12e3) };
    for backend in [Backend::Tetrahedra, Backend::Lattice(LatticeSettings { cell: 3e-3, ..Default::default() })] {
        let tilted = GRAVITY + 0.2 * 9.81 * DVec3::X;
        let mut builder = ModelBuilder::new().gravity(tilted).backend(backend).body_contact(BodyContact::default());
        let foot = nodes(&mesh, |p| p.z == 0.0);
        let edge = nodes(&upper, |p| p.x < 2e-3 && p.z > 24e-3);
        for (name, mesh, pinned) in [("lower", &mesh, foot), ("upper", &upper, edge)] {
            builder.body(BodyDescription { name: name.into(), mesh, material, pinned, supports: vec![] }).unwrap();
        }
        let model = builder.build().unwrap();
        let (mut state, mut stepper) =
            (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
        for _ in 0..180 {
            stepper.step(&model, &mut state, &[]);
        }
        let places = |state: &State| [0, 1].map(|body| state.positions(&model, body));
        let settled = places(&state);
        for frame in 0..60 {
            let report = stepper.step(&model, &mut state, &[]);
            assert_eq!(report.iterations, 0, "{backend:?}, frame {frame}");
        }
        assert_eq!(places(&state), settled, "{backend:?}");
    }
}
