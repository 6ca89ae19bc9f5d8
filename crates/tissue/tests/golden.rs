//! Golden hashes: refactoring keeps every bit of the results.
//!
//! Each scene exercises other parts of the solvers: a rigid grasp and supports, bodies that touch
//! each other and a tool's jaws, loads, and a state with inverted elements. A change of the method
//! changes these numbers; then record them again (the failing test prints them) and say why in the
//! commit. They hold on x86-64 and on 64-bit ARM (`cargo xtask aarch64`).

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_core::Pose;
use trocar_testing::blocks::{self, FRAME, GRAVITY, block, nodes, three_bodies, tissue};
use trocar_tissue::{
    BodyContact, BodyDescription, Collider, Compliance, Grasp, Load, Material, Model, ModelBuilder, Shape,
    SolverSettings, State, Stepper, SupportField, SupportPlane, ToolMotion,
};

fn at(translation: DVec3) -> Pose {
    Pose { translation, ..Pose::IDENTITY }
}

/// A parabola from 0 to 1 and back over `frames`.
fn bump(frame: usize, frames: usize) -> f64 {
    let t = frame as f64 / frames as f64;
    4.0 * t * (1.0 - t)
}

/// Steps `frames` frames; checks that one thread and three agree and that a saved state restores.
fn hashes(model: &Model, start: &State, frames: usize, tools: &dyn Fn(usize) -> Vec<Pose>, loads: &[Load]) -> [u64; 3] {
    [SolverSettings::FAST, SolverSettings::PAPER, blocks::adaptive()].map(|schedule| {
        let run = |threads: usize| {
            let mut stepper = Stepper::new(model, schedule, FRAME, threads).unwrap();
            let mut state = start.clone();
            for k in 0..frames {
                let motions = tools(k).into_iter().zip(tools(k + 1));
                let motions: Vec<ToolMotion> = motions.map(|(from, to)| ToolMotion { from, to }).collect();
                stepper.step_with_loads(model, &mut state, &motions, loads);
                if k == frames / 2 {
                    let mut restored = State::new(model);
                    restored.clone_from(&state);
                    assert_eq!(restored.hash(), state.hash());
                    stepper = Stepper::new(model, schedule, FRAME, threads).unwrap();
                    state = restored;
                }
            }
            state.hash()
        };
        let one = run(1);
        assert_eq!(one, run(3), "{schedule:?}: threads");
        one
    })
}

fn check(scene: &str, found: [u64; 3], golden: [u64; 3]) {
    assert_eq!(found, golden, "{scene}: [{:#018x}, {:#018x}, {:#018x}]", found[0], found[1], found[2]);
}

/// One body held by a tool, one that falls on a plane, one that lies on a field.
#[test]
fn rigid_grasp_and_supports() {
    let (model, held) = three_bodies();
    let mut state = State::new(&model);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY));
    let tools = |k: usize| vec![at(DVec3::new(1e-3, 0.0, 5e-3) * bump(k, 60))];
    let found = hashes(&model, &state, 60, &tools, &[]);
    check("rigid grasp and supports", found, [0x9d30aa8ca7b17400, 0x4ef911657db81c68, 0x076af93f8376e204]);
}

/// A block on a pinned one, a third that flies into them, jaws that lift one compliantly, a probe.
fn touching_bodies() -> (Model, State) {
    let contact = BodyContact { folds: true, ..BodyContact::default() };
    let mut builder = ModelBuilder::new().gravity(GRAVITY).body_contact(contact);
    let material = Material { viscosity: 40.0, ..tissue(12e3) };
    let low = block([6, 6, 3], 2.5e-3);
    let moved = |by: DVec3, cells: [usize; 3]| {
        let mut mesh = block(cells, 2.5e-3);
        mesh.vertices.iter_mut().for_each(|p| *p += by);
        mesh
    };
    let high = moved(DVec3::new(2e-3, 1e-3, 8.8e-3), [5, 5, 2]);
    let thrown = moved(DVec3::new(-12e-3, 4e-3, 10e-3), [3, 3, 3]);
    let far = moved(DVec3::new(0.0, 40e-3, 0.0), [3, 3, 3]);
    let pinned = nodes(&low, |p| p.z == 0.0);
    let far_pinned = nodes(&far, |p| p.z == 0.0);
    for (name, mesh, pinned) in
        [("low", &low, pinned), ("high", &high, vec![]), ("thrown", &thrown, vec![]), ("far", &far, far_pinned)]
    {
        builder.body(BodyDescription { name: name.into(), mesh, material, pinned, supports: vec![] }).unwrap();
    }
    for (name, tool, y) in [("blade", 0, 0.5e-3), ("other blade", 1, 14e-3)] {
        let shape = Shape::Box {
            centre: DVec3::new(18e-3, y, 12e-3),
            rotation: glam::DQuat::IDENTITY,
            half: DVec3::splat(1.5e-3),
        };
        builder.collider(Collider { name: name.into(), tool, shape, rest_offset: 1e-3, friction: 0.5 }).unwrap();
    }
    let shape = Shape::Capsule { ends: [DVec3::new(4e-3, 44e-3, 12e-3), DVec3::new(4e-3, 44e-3, 30e-3)], radius: 2e-3 };
    builder.collider(Collider { name: "probe".into(), tool: 2, shape, rest_offset: 1.5e-3, friction: 0.3 }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    for node in 0..model.bodies()[2].len() {
        state.set_velocity(&model, 2, node, DVec3::new(0.4, 0.0, 0.0));
    }
    let held = nodes(&high, |p| p.x > 12e-3);
    let jaws = Compliance {
        stiffness: 300.0,
        closing: DVec3::Y,
        jaw_force: 0.2,
        friction: 0.6,
        tear_force: 1e3,
        blades: Some([0, 1]),
    };
    state.grasps.push(Grasp::capture(&model, &state, 1, &held, 0, &Pose::IDENTITY).compliant(jaws));
    (model, state)
}

/// Where the tools of [`touching_bodies`] are.
fn lift_and_probe(frame: usize) -> Vec<Pose> {
    let lift = at(DVec3::Z * 6e-3 * bump(frame, 60));
    vec![lift, lift, at(DVec3::Z * -6e-3 * bump(frame, 60))]
}

#[test]
fn bodies_and_tools_that_touch() {
    let (model, state) = touching_bodies();
    let found = hashes(&model, &state, 40, &lift_and_probe, &[]);
    check("bodies and tools that touch", found, [0x3beec752a0acb48f, 0x0d1708b41bcb6975, 0x055e40eba2d49827]);
}

/// Loads, a state with inverted elements, and one that is stretched.
#[test]
fn loads_and_disturbed_states() {
    let (model, mut state) = touching_bodies();
    state.grasps.clear();
    for node in 0..model.bodies()[3].len() {
        let x = state.position(&model, 3, node);
        state.set_position(&model, 3, node, DVec3::new(-x.x, x.y, x.z));
    }
    for node in 0..model.bodies()[1].len() {
        let x = state.position(&model, 1, node);
        state.set_position(&model, 1, node, DVec3::new(1.3 * x.x, x.y, x.z));
    }
    let loads = [(0, 40, DVec3::new(0.01, 0.0, 0.02)), (2, 5, DVec3::new(0.0, 1e-3, 1e-3))];
    let loads = loads.map(|(body, node, force)| Load { body, node, force });
    let found = hashes(&model, &state, 20, &lift_and_probe, &loads);
    check("loads and disturbed states", found, [0xaf6af53cfab135e6, 0xcd360257a027b56f, 0x19e95c2450f8cd8a]);
}

/// A block that a rigid grasp crushes.
#[test]
fn crushed_block() {
    let mesh = block([3, 3, 3], 2e-3);
    let material = Material { viscosity: 4.0, ..tissue(8e3) };
    let model = blocks::model(&mesh, material, nodes(&mesh, |p| p.z == 0.0), GRAVITY);
    let mut state = State::new(&model);
    let held = nodes(&mesh, |p| p.z > 5e-3);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY));
    let tools = |k: usize| vec![at(DVec3::new(3e-3, 0.0, -5.5e-3) * bump(k, 30))];
    let found = hashes(&model, &state, 30, &tools, &[]);
    check("crushed block", found, [0xed8cf8f8b68c2a92, 0xaa5ba28d0a7f7b46, 0xd4a0413ba037c401]);
}

/// A block on a plane, crushed and hit by a ball.
#[test]
fn struck_block() {
    let mesh = block([4, 4, 3], 2e-3);
    let mut builder = ModelBuilder::new().gravity(GRAVITY).body_contact(BodyContact::default());
    let plane = SupportPlane { point: DVec3::ZERO, normal: DVec3::Z, friction: 0.6 };
    let field = SupportField::under(&mesh, DVec3::Z, 1e-3, 0.4).unwrap();
    let mut beside = mesh.clone();
    beside.vertices.iter_mut().for_each(|p| p.x += 9e-3);
    for (mesh, support) in [(&mesh, plane.into()), (&beside, field.into())] {
        let (material, supports) = (Material { viscosity: 4.0, ..tissue(3e3) }, vec![support]);
        builder.body(BodyDescription { name: "block".into(), mesh, material, pinned: vec![], supports }).unwrap();
    }
    let shape = Shape::Sphere { centre: DVec3::new(4e-3, 4e-3, 12e-3), radius: 3e-3 };
    builder.collider(Collider { name: "ball".into(), tool: 0, shape, rest_offset: 1.5e-3, friction: 0.5 }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let held = nodes(&mesh, |p| p.x < 1e-3);
    state.grasps.push(Grasp::capture(&model, &state, 0, &held, 1, &Pose::IDENTITY));
    let tools = |k: usize| {
        let t = bump(k, 12);
        vec![at(DVec3::new(2e-3, 0.0, -11e-3) * t), at(DVec3::new(8e-3, 0.0, -3e-3) * t)]
    };
    let found = hashes(&model, &state, 24, &tools, &[]);
    check("struck block", found, [0x9a71576e0e660f47, 0x3c20022facd7e2f5, 0xc8346ceee9b40c32]);
}

/// Elements pressed almost flat, thrown inwards and hit: it overstretches.
#[test]
fn flat_elements() {
    let mesh = block([4, 4, 3], 2e-3);
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let (pinned, material) = (nodes(&mesh, |p| p.z == 0.0), tissue(12e3));
    builder.body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let shape = Shape::Sphere { centre: DVec3::new(4e-3, 4e-3, 9e-3), radius: 2e-3 };
    builder.collider(Collider { name: "ball".into(), tool: 0, shape, rest_offset: 1.5e-3, friction: 0.5 }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let middle = DVec3::new(4e-3, 4e-3, 1e-3);
    for node in nodes(&mesh, |p| p.z > 5.9e-3 && (p.x - p.y).abs() < 1e-9) {
        let (node, x) = (node as usize, mesh.vertices[node as usize]);
        state.set_position(&model, 0, node, x.lerp(middle, 0.3));
        state.set_velocity(&model, 0, node, 8.0 * (middle - x).normalize());
    }
    let tools = |k: usize| vec![at(DVec3::new(0.0, 0.0, -9e-3) * bump(k, 6))];
    let found = hashes(&model, &state, 12, &tools, &[]);
    check("flat elements", found, [0x5c5ac4b1ded3ac4b, 0x2cb97c27f08a2397, 0xf5a74bf1cbfeb030]);
}

/// A spring of negative stiffness: the matrix has no Cholesky factor, and sweeps take over in the
/// whole island.
#[test]
fn fallback_to_sweeps() {
    let (model, mut state) = touching_bodies();
    if let Some(jaws) = &mut state.grasps[0].compliance {
        jaws.stiffness = -30.0;
    }
    let found = hashes(&model, &state, 12, &lift_and_probe, &[]);
    check("fallback to sweeps", found, [0xaaae6882dc53770c, 0x77f5de6435d096d2, 0xb417e5e4aac10469]);
}
