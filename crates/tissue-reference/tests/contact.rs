//! Contact of the fast solver against the oracle's: force on the tool and field of displacement.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, block, nodes, tissue};
use trocar_tissue::{
    BodyContact, BodyDescription, Collider, Grasp, Material, Model, ModelBuilder, Shape, SolverSettings, State,
    Stepper, ToolContact, ToolMotion,
};
use trocar_tissue_reference::{Held, Oracle, OracleState};

/// Height of the layer (m).
const TOP: f64 = 8e-3;

/// Sizes of its triangles (m).
const EDGES: [f64; 3] = [4e-3, 8e-3 / 3.0, 2e-3];

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

fn material() -> Material {
    Material { viscosity: 20.0, ..tissue(5e3) }
}

/// A box with triangles of this edge.
fn cuboid(size: [f64; 3], edge: f64) -> trocar_geometry::TetMesh {
    block(size.map(|length| (length / edge).round() as usize), edge)
}

/// A layer of 24 x 24 x 8 mm that is fixed to its ground, and a tool.
fn layer(edge: f64, shape: Shape, friction: f64, contact: ToolContact) -> Model {
    let mesh = cuboid([24e-3, 24e-3, TOP], edge);
    let mut builder = ModelBuilder::new().gravity(DVec3::ZERO).tool_contact(contact);
    let (name, pinned) = ("layer".into(), nodes(&mesh, |p| p.z == 0.0));
    builder.body(BodyDescription { name, mesh: &mesh, material: material(), pinned, supports: vec![] }).unwrap();
    builder.collider(Collider { name: "tool".into(), tool: 0, shape, rest_offset: 0.0, friction }).unwrap();
    builder.build().unwrap()
}

/// Steps the fast solver with the tool at `place(frame)`, from frame to frame.
fn stepped(model: &Model, state: &mut State, frames: u32, place: impl Fn(u32) -> Pose) -> Stepper {
    let mut stepper = Stepper::new(model, SolverSettings::FAST, FRAME, 1).unwrap();
    for k in 0..frames {
        let report = stepper.step(model, state, &[ToolMotion { from: place(k), to: place(k + 1) }]);
        assert_eq!((report.fallbacks, report.inverted, report.divergence), (0, 0, None));
    }
    stepper
}

/// Greatest distance between the two places of a node, over the greatest displacement.
fn field_error(model: &Model, state: &State, exact: &OracleState) -> f64 {
    let farthest = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let (mut off, mut moved) = (0.0f64, 0.0f64);
    for (b, body) in model.bodies().iter().enumerate() {
        off = off.max(farthest(&state.positions(model, b), exact.positions(b)));
        moved = moved.max(farthest(exact.positions(b), body.rest_positions()));
    }
    off / moved
}

#[test]
fn a_pressed_sphere_meets_the_oracles_force_and_field() {
    let (radius, depth) = (4e-3, 1.2e-3);
    let centre = DVec3::new(12.3e-3, 11.6e-3, 0.0);
    for (contact, edge) in [ToolContact::Vertices, ToolContact::Surface].into_iter().flat_map(|c| EDGES.map(|e| (c, e)))
    {
        let model = layer(edge, Shape::Sphere { centre, radius }, 0.0, contact);
        let lowered = |share: f64| at(DVec3::Z * (TOP + radius - depth * share));
        let mut state = State::new(&model);
        let stepper = stepped(&model, &mut state, 60, |k| lowered(f64::from(k.min(20)) / 20.0));
        let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
        for part in 1..=4 {
            oracle.settle_with_tools(&model, &mut exact, &[], &[lowered(f64::from(part) / 4.0)]).unwrap();
        }
        let (fast, truth) = (stepper.forces()[0], oracle.forces()[0]);
        let error = (fast.contact.force - truth.contact.force).length() / truth.contact.force.length();
        let field = field_error(&model, &state, &exact);
        println!(
            "{contact:?}, {:.2} mm: {:.5} N, oracle {:.5} N, off by {:.3}%, field by {:.3}%; {} and {} touch",
            1e3 * edge,
            fast.contact.force.z,
            truth.contact.force.z,
            1e2 * error,
            1e2 * field,
            fast.touching,
            truth.touching
        );
        assert_eq!(fast.touching, truth.touching);
        assert!(error < 0.02 && field < 0.02, "force off by {error}, field by {field}");
    }
}

/// The force along the surface when it begins to slide, of both; `speed` is in m/s.
fn threshold(contact: ToolContact, speed: f64) -> [f64; 2] {
    /// Substeps of the fast solver in a frame, and frames to press.
    const SUBSTEPS: u32 = 2;
    const DOWN: u32 = 8;
    let (radius, depth, way) = (3e-3, 1e-3, 2.4e-3);
    let ends = [DVec3::new(8.3e-3, 7.1e-3, 0.0), DVec3::new(8.7e-3, 16.6e-3, 0.0)];
    let model = layer(EDGES[1], Shape::Capsule { ends, radius }, 0.15, contact);
    let place = |t: f64| {
        let (down, along) = ((t / f64::from(DOWN)).min(1.0), speed * FRAME * (t - f64::from(DOWN)).max(0.0));
        at(DVec3::new(along, 0.0, TOP + radius - depth * down))
    };
    let (mut state, mut stepper) = (State::new(&model), Stepper::new(&model, SolverSettings::FAST, FRAME, 1).unwrap());
    let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
    let motion = |from: f64, to: f64| [ToolMotion { from: place(from), to: place(to) }];
    let (mut most, mut last) = ([0.0f64; 2], [0.0f64; 2]);
    for k in 0..DOWN + (way / (speed * FRAME)).round() as u32 {
        let from = f64::from(k);
        stepper.step(&model, &mut state, &motion(from, from + 1.0));
        for s in 0..SUBSTEPS {
            let [a, b] = [s, s + 1].map(|s| from + f64::from(s) / f64::from(SUBSTEPS));
            oracle.step_with_tools(&model, &mut exact, FRAME / f64::from(SUBSTEPS), &[], &motion(a, b)).unwrap();
        }
        if k >= DOWN {
            let forces = [stepper.forces()[0], oracle.forces()[0]];
            last = forces.map(|force| -force.contact.force.x);
            most = [0, 1].map(|i| most[i].max(last[i]));
        }
    }
    assert!((0..2).all(|i| last[i] < 0.99 * most[i]), "it slides: {most:?} N, {last:?} N at the end");
    println!("{contact:?}, {speed} m/s: slides at {:.5} N, oracle {:.5} N", most[0], most[1]);
    most
}

#[test]
fn a_dragged_capsule_slides_at_the_oracles_force() {
    for contact in [ToolContact::Vertices, ToolContact::Surface] {
        let [fast, truth] = threshold(contact, 6e-3);
        assert!((fast / truth - 1.0).abs() < 0.04, "{fast} N, {truth} N");
    }
}

/// A block whose top is held goes down onto a layer, by which it is pushed back.
#[test]
fn a_body_on_another_meets_the_oracles_force() {
    let (gap, depth) = (1.7e-3, 2e-3);
    for edge in [EDGES[0], EDGES[1]] {
        let (lower, mut upper) = (cuboid([24e-3, 24e-3, TOP], edge), cuboid([8e-3; 3], edge));
        upper.vertices.iter_mut().for_each(|p| *p += DVec3::new(7.3e-3, 8.4e-3, TOP + gap));
        let contact = BodyContact { friction: 0.0, ..BodyContact::default() };
        let mut builder = ModelBuilder::new().gravity(DVec3::ZERO).body_contact(contact);
        for (name, mesh) in [("lower", &lower), ("upper", &upper)] {
            let (name, pinned) = (name.into(), nodes(mesh, |p| p.z == 0.0));
            builder.body(BodyDescription { name, mesh, material: material(), pinned, supports: vec![] }).unwrap();
        }
        let model = builder.build().unwrap();
        let mut state = State::new(&model);
        let held = nodes(&upper, |p| p.z > TOP + gap + 7.9e-3);
        let grasp = Grasp::capture(&model, &state, 1, &held, 0, &Pose::IDENTITY);
        state.grasps.push(grasp.clone());
        let lowered = |share: f64| at(DVec3::Z * -depth * share);
        let stepper = stepped(&model, &mut state, 90, |k| lowered(f64::from(k.min(30)) / 30.0));
        let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
        for part in 1..=4 {
            let held = Held::by(&grasp, &lowered(f64::from(part) / 4.0));
            oracle.settle(&model, &mut exact, &held).unwrap();
        }
        let loads = stepper.contact_loads(&model, &state);
        let fast: DVec3 = loads.iter().filter(|load| load.body == 1).map(|load| load.force).sum();
        let [lower, truth] = oracle.pushes() else { panic!("two bodies") };
        let error = (fast - *truth).length() / truth.length();
        let field = field_error(&model, &state, &exact);
        println!(
            "{:.2} mm: {:.5} N, oracle {:.5} N, off by {:.3}%, field by {:.3}%",
            1e3 * edge,
            fast.z,
            truth.z,
            1e2 * error,
            1e2 * field
        );
        assert!((*lower + *truth).length() < 1e-9, "what presses is pressed: {lower} N, {truth} N");
        assert!(error < 0.02 && field < 0.02, "force off by {error}, field by {field}");
    }
}

/// The oracle judges contact of the elements' boundary, and says so.
#[test]
fn another_surface_is_refused() {
    let mesh = cuboid([24e-3, 24e-3, TOP], 4e-3);
    let mut builder = ModelBuilder::new();
    builder
        .body(BodyDescription {
            name: "layer".into(),
            mesh: &mesh,
            material: material(),
            pinned: vec![],
            supports: vec![],
        })
        .unwrap();
    builder.collision_surface(0, &mesh.boundary().0).unwrap();
    let model = builder.build().unwrap();
    let (mut oracle, mut exact) = (Oracle::new(&model), OracleState::new(&model));
    let message = oracle.step(&model, &mut exact, FRAME, &[]).unwrap_err().to_string();
    assert!(message.contains("body 'layer' has a collision surface of its own"), "{message}");
}
