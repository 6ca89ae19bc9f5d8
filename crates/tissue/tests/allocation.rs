//! Stepping allocates nothing.

use glam::DVec3;
use std::sync::Mutex;
use trocar_core::Pose;
use trocar_testing::blocks::{FRAME, GRAVITY, block, nodes, tissue};
use trocar_testing::{PEAK, Peak};
use trocar_tissue::{
    BodyContact, BodyDescription, Collider, Compliance, Grasp, Load, Material, ModelBuilder, Shape, SolverSettings,
    State, Stepper, ToolMotion,
};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// One test at a time: all share the count.
static ALONE: Mutex<()> = Mutex::new(());

#[test]
fn stepping_bodies_that_touch_allocates_nothing() {
    const FRAMES: usize = 40;
    let _alone = ALONE.lock();
    let low = block([8, 8, 4], 2.5e-3);
    let mut high = low.clone();
    high.vertices.iter_mut().for_each(|p| *p += DVec3::new(2e-3, 1e-3, 11.4e-3));
    let pinned = nodes(&low, |p| p.z == 0.0);
    let mut builder = ModelBuilder::new().gravity(GRAVITY).body_contact(BodyContact::default());
    let material = Material { viscosity: 40.0, ..tissue(12e3) };
    for (mesh, pinned) in [(&low, pinned), (&high, vec![])] {
        builder.body(BodyDescription { name: "block".into(), mesh, material, pinned, supports: vec![] }).unwrap();
    }
    let model = builder.build().unwrap();
    for schedule in [SolverSettings::FAST, SolverSettings::PAPER] {
        let mut state = State::new(&model);
        let mut stepper = Stepper::new(&model, schedule, FRAME, 2).unwrap();
        // Lists grow to their greatest length.
        (0..30).for_each(|_| assert_eq!(stepper.step(&model, &mut state, &[]).divergence, None));
        let before = PEAK.allocations();
        (0..FRAMES).for_each(|_| assert_eq!(stepper.step(&model, &mut state, &[]).divergence, None));
        let during = PEAK.allocations() - before;
        assert!(during < FRAMES / 4, "{schedule:?}: {during} allocations in {FRAMES} frames");
    }
}

#[test]
fn stepping_allocates_nothing() {
    const FRAMES: usize = 40;
    let _alone = ALONE.lock();
    // Large enough for several tasks a colour.
    let mesh = block([16, 16, 10], 2e-3);
    let material = Material { viscosity: 4.0, ..tissue(12e3) };
    let mut builder = ModelBuilder::new().gravity(GRAVITY);
    let pinned = nodes(&mesh, |p| p.z == 0.0);
    builder.body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let ends = [DVec3::new(20e-3, 0.0, 21e-3), DVec3::new(20e-3, 32e-3, 21e-3)];
    let shape = Shape::Capsule { ends, radius: 2e-3 };
    builder.collider(Collider { name: "bar".into(), tool: 0, shape, rest_offset: 0.0, friction: 0.6 }).unwrap();
    let model = builder.build().unwrap();
    let mut state = State::new(&model);
    let held = nodes(&mesh, |p| p.z > 19e-3 && p.x < 10e-3);
    let hanging = nodes(&mesh, |p| p.z > 19e-3 && p.x > 28e-3);
    let compliance = Compliance {
        stiffness: 200.0,
        closing: DVec3::Y,
        jaw_force: 0.01,
        friction: 0.6,
        tear_force: 5.0,
        blades: None,
    };
    state.grasps = vec![
        Grasp::capture(&model, &state, 0, &held, 0, &Pose::IDENTITY),
        Grasp::capture(&model, &state, 0, &hanging, 0, &Pose::IDENTITY).compliant(compliance),
    ];
    let mut stepper = Stepper::new(&model, SolverSettings::default(), FRAME, 2).unwrap();
    let still = ToolMotion { from: Pose::IDENTITY, to: Pose::IDENTITY };
    stepper.step(&model, &mut state, &[still]);
    let before = PEAK.allocations();
    let load = Load { body: 0, node: mesh.vertices.len() - 1, force: DVec3::Z * 1e-3 };
    for _ in 0..FRAMES {
        stepper.step_with_loads(&model, &mut state, &[still], &[load]);
    }
    let during = PEAK.allocations() - before;
    // The thread pool's queue takes a new block now and then, once in dozens of frames; our own
    // code would show in every frame.
    assert!(during < FRAMES / 4, "{during} allocations in {FRAMES} frames");
}
