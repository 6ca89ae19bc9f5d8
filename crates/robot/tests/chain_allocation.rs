//! The step of an arm, its kinematics, inverse kinematics and control do not allocate.

mod common;

use glam::DVec3;
use trocar_robot::chain::{ArmState, Coupling, CouplingLaw, Drive, InverseOptions, SerialArm};
use trocar_testing::{PEAK, Peak};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

#[test]
fn steps_and_searches_do_not_allocate() {
    let arm = SerialArm::franka_fr3().unwrap().with_payload(common::rod(0.5, 0.2)).unwrap();
    let mut state = ArmState::at_rest(arm.home());
    let options = InverseOptions { restarts: 4, ..InverseOptions::default() };
    let before = PEAK.allocations_of_thread();
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
    let during = PEAK.allocations_of_thread() - before;
    let mut controlled = common::cell(0, trocar_robot::manipulator::ControllerSettings::default());
    let start = controlled.commanded();
    let made = PEAK.allocations_of_thread();
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
    let controlling = PEAK.allocations_of_thread() - made;
    assert_eq!(controlling, 0, "allocations of a manipulator");

    assert!(pushed > 0.0);
    assert_eq!(during, 0, "allocations");
}
