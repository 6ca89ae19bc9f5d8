//! Stepping allocates nothing.

mod common;

use common::{FRAME, GRAVITY, block, nodes, tissue};
use glam::DVec3;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use trocar_geometry::Pose;
use trocar_tissue::{
    BodyDescription, Collider, Compliance, Grasp, Material, ModelBuilder, Schedule, Shape, State, Stepper, ToolMotion,
};

/// The system's allocator, counting.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator cannot be written without")]
// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promises are handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above, that is, from the system.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn stepping_allocates_nothing() {
    const FRAMES: usize = 40;
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
    let mut stepper = Stepper::new(&model, Schedule::default(), FRAME, 2).unwrap();
    let still = ToolMotion { from: Pose::IDENTITY, to: Pose::IDENTITY };
    stepper.step(&model, &mut state, &[still]);
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for _ in 0..FRAMES {
        stepper.step(&model, &mut state, &[still]);
    }
    let during = ALLOCATIONS.load(Ordering::Relaxed) - before;
    // The thread pool's queue takes a new block now and then, once in dozens of frames; our own code would show in every frame.
    assert!(during < FRAMES / 4, "{during} allocations in {FRAMES} frames");
}
