//! Contact of the fast solver against the oracle's.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, block, nodes, tissue};
use trocar_tissue::{
    BodyDescription, Collider, Material, Model, ModelBuilder, Shape, SolverSettings, State, Stepper, ToolContact,
    ToolForce, ToolMotion,
};
use trocar_tissue_reference::{Oracle, OracleState};

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

/// A layer of 24 x 24 x 8 mm that is fixed to its ground, with triangles of this edge, and a tool.
fn layer(edge: f64, shape: Shape, friction: f64, contact: ToolContact) -> Model {
    let cells = |length: f64| (length / edge).round() as usize;
    let mesh = block([cells(24e-3), cells(24e-3), cells(8e-3)], edge);
    let mut builder = ModelBuilder::new().gravity(DVec3::ZERO).tool_contact(contact);
    let material = Material { viscosity: 20.0, ..tissue(5e3) };
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "layer".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    builder.collider(Collider { name: "tool".into(), tool: 0, shape, rest_offset: 0.0, friction }).unwrap();
    builder.build().unwrap()
}

/// Lowers the tool to `depth` below the layer's top in 30 frames and holds it for 60.
fn pressed(model: &Model, radius: f64, depth: f64) -> (State, ToolForce) {
    let (mut state, mut stepper) = (State::new(model), Stepper::new(model, SolverSettings::FAST, FRAME, 1).unwrap());
    let place =
        |frame: u32| at(DVec3::Z * (8e-3 + radius + 0.2e-3 - (depth + 0.2e-3) * f64::from(frame.min(30)) / 30.0));
    for k in 0..90 {
        let report = stepper.step(model, &mut state, &[ToolMotion { from: place(k), to: place(k + 1) }]);
        assert_eq!((report.fallbacks, report.inverted, report.divergence), (0, 0, None));
    }
    (state, stepper.forces()[0])
}

#[test]
fn a_pressed_sphere_meets_the_oracles_force() {
    let (radius, depth) = (4e-3, 1.2e-3);
    for contact in [ToolContact::Vertices, ToolContact::Surface] {
        for edge in [4e-3, 8e-3 / 3.0, 2e-3] {
            let centre = DVec3::new(12.3e-3, 11.6e-3, 0.0);
            let model = layer(edge, Shape::Sphere { centre, radius }, 0.0, contact);
            let clock = std::time::Instant::now();
            let (state, fast) = pressed(&model, radius, depth);
            let fast_time = clock.elapsed();
            let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
            let mut solution = Vec::new();
            let clock = std::time::Instant::now();
            for part in 1..=4 {
                let z = 8e-3 + radius - depth * f64::from(part) / 4.0;
                solution = oracle.settle_with_tools(&model, &mut exact, &[], &[at(DVec3::Z * z)]).unwrap();
            }
            let truth = oracle.forces()[0];
            let moved: Vec<DVec3> =
                exact.positions(0).iter().zip(model.bodies()[0].rest_positions()).map(|(a, b)| *a - *b).collect();
            let off = state
                .positions(&model, 0)
                .iter()
                .zip(exact.positions(0))
                .map(|(a, b)| a.distance(*b))
                .fold(0.0, f64::max);
            let most = moved.iter().map(|d| d.length()).fold(0.0, f64::max);
            println!(
                "{contact:?} {:.2} mm: fast {:.5} N, oracle {:.5} N ({:+.2}%), field off by {:.4} of {:.3} mm; {} of {} touch; {solution:?}; {fast_time:.1?} {:.1?}",
                edge * 1e3,
                fast.contact.force.z,
                truth.contact.force.z,
                1e2 * (fast.contact.force.z / truth.contact.force.z - 1.0),
                off * 1e3,
                most * 1e3,
                fast.touching,
                truth.touching,
                clock.elapsed()
            );
        }
    }
}
