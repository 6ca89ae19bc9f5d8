//! Stage 6: the force guard sees the load of the frame, and stops an arm that would pass its limit.

use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Wanted};
use crate::cell::rules::TissueAtArm;

impl Cell {
    /// `tissue`: the strain of the tissue at each arm.
    pub(super) fn stop_in_time(&mut self, tissue: &[TissueAtArm]) {
        for (arm, tissue) in self.arms.iter_mut().zip(tissue) {
            arm.stop_in_time(*tissue);
        }
    }
}

impl ArmUnit {
    fn stop_in_time(&mut self, tissue: TissueAtArm) {
        let Self { model, drive, state } = self;
        let force = state.exchange.force() + state.solid.force();
        state.guard.end_frame(force, tissue, state.gripper.pose.translation, model.force_limit);
        // Commands of joints are not guarded.
        if matches!(state.wanted, Wanted::Setpoint(..)) && state.guard.must_stop(model.force_limit) {
            drive.halt();
            state.commanded = drive.reference().with_jaw(state.commanded.jaw());
            (state.guarded, state.held_back) = (true, true);
        }
    }
}
