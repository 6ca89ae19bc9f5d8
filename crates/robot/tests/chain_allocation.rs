//! The step of an arm, its kinematics, inverse kinematics and control do not allocate.

mod common;

use glam::DVec3;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use trocar_robot::chain::{ArmState, Coupling, CouplingLaw, Drive, InverseOptions, SerialArm};

/// The system's allocator with a counter.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code, reason = "an allocator cannot be written without")]
// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's guarantees hold for the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above, so from the system.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn steps_and_searches_do_not_allocate() {
    let arm = SerialArm::franka_fr3().unwrap().with_payload(common::rod(0.5, 0.2)).unwrap();
    let mut state = ArmState::at_rest(arm.home());
    let options = InverseOptions { restarts: 4, ..InverseOptions::default() };
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    let mut pushed = 0.0;
    for _ in 0..480 {
        let dynamics = arm.dynamics(&state.q, &state.qd);
        let flange = dynamics.frames.flange();
        let row = dynamics.frames.flange_jacobian().row(DVec3::Z);
        let mut touch = [Coupling::new(row, flange.translation.z - 0.6, 3e4, CouplingLaw::Push)];
        let drive = Drive { torque: arm.zeros(), external: arm.zeros() };
        arm.step(&mut state, &drive, &mut touch, 1.0 / 480.0, 2).unwrap();
        pushed += touch[0].force;
        arm.inverse(&flange, &arm.home(), &options).unwrap();
    }
    let during = ALLOCATIONS.load(Ordering::Relaxed) - before;
    let mut controlled = common::cell(0, trocar_robot::manipulator::ControllerSettings::default());
    let start = controlled.commanded();
    let made = ALLOCATIONS.load(Ordering::Relaxed);
    for k in 0..480 {
        if k % 16 == 0 {
            let tip = common::tip_circle(&controlled, &start, f64::from(k) / 480.0);
            controlled.servo_tip(&tip, 0.5).unwrap();
            controlled.servo_cp(&trocar_robot::instrument::Coordinates { roll: 3.0, ..start }).unwrap();
        }
        let state = controlled.state();
        controlled.restore(&state).unwrap();
        controlled.step(trocar_core::Wrench::default(), 1.0 / 480.0).unwrap();
        pushed += controlled.measured_cf().force.length() + controlled.coordinates().0.insertion;
    }
    let controlling = ALLOCATIONS.load(Ordering::Relaxed) - made;
    assert_eq!(controlling, 0, "allocations of a manipulator");

    assert!(pushed > 0.0);
    assert_eq!(during, 0, "allocations");
}
