//! Crushed tissue that is let go comes back: its nodes are not thrown out of the body.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, block, tissue};
use trocar_tissue::{BodyDescription, Model, ModelBuilder, SolverSettings, State, Stepper};

/// Length of the most stretched edge over that at rest.
fn stretch(mesh: &TetMesh, now: &[DVec3]) -> f64 {
    let edges = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let all = mesh.tets.iter().flat_map(|t| edges.map(|(i, k)| [t[i] as usize, t[k] as usize]));
    all.map(|[a, b]| now[a].distance(now[b]) / mesh.vertices[a].distance(mesh.vertices[b])).fold(0.0, f64::max)
}

/// Least volume of an element over that at rest.
fn least_volume(mesh: &TetMesh, now: &[DVec3]) -> f64 {
    let volume = |x: &[DVec3], t: &[u32; 4]| {
        let [a, b, c, d] = t.map(|i| x[i as usize]);
        (b - a).cross(c - a).dot(d - a)
    };
    mesh.tets.iter().map(|t| volume(now, t) / volume(&mesh.vertices, t)).fold(f64::INFINITY, f64::min)
}

/// A block on a pinned floor.
fn pinned_block(mesh: &TetMesh) -> Model {
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z < 1e-9).collect();
    let body = BodyDescription { name: "block".into(), mesh, material: tissue(12e3), pinned, supports: vec![] };
    let mut builder = ModelBuilder::new();
    builder.body(body).unwrap();
    builder.build().unwrap()
}

/// A node of the top is pressed inwards until an element is nearly flat, and goes on inwards when
/// it is let go: it cannot go where it goes by itself, and the flat element's barrier presses on it
/// a thousand times harder than the stiffness at rest explains.
#[test]
fn nodes_of_crushed_elements_are_not_thrown_out() {
    let mesh = block([4, 4, 3], 2e-3);
    let model = pinned_block(&mesh);
    let mut stepper = Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap();
    let middle = DVec3::new(4e-3, 4e-3, 1e-3);
    for node in (0..mesh.vertices.len()).filter(|i| mesh.vertices[*i].z > 5.9e-3) {
        for volume in [0.2, 0.02, 0.005] {
            let inwards = (middle - mesh.vertices[node]).normalize();
            let pressed = |way: f64| {
                let mut x = mesh.vertices.clone();
                x[node] += way * inwards;
                x
            };
            let (mut low, mut high) = (0.0, 4e-3);
            for _ in 0..50 {
                let way = 0.5 * (low + high);
                if least_volume(&mesh, &pressed(way)) > volume { low = way } else { high = way }
            }
            let mut state = State::new(&model);
            state.set_position(&model, 0, node, pressed(low)[node]);
            state.set_velocity(&model, 0, node, 0.2 * inwards);
            for frame in 0..5 {
                let report = stepper.step(&model, &mut state, &[]);
                let most = stretch(&mesh, &state.positions(&model, 0));
                assert!(report.inverted == 0 && report.divergence.is_none(), "node {node}, {volume}: {report:?}");
                assert!(most < 1.5, "node {node} at {volume} of the volume, frame {frame}: stretched {most:.2} times");
            }
        }
    }
}
