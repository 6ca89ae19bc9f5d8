//! Stage 6: the force guard sees the load of the frame, and stops an arm that would pass its limit.

use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Wanted};

impl Cell {
    /// `strains`: for each arm, the share of its limit that the strain of the tissue at it has.
    pub(super) fn stop_in_time(&mut self, strains: &[f64]) {
        for (arm, strain) in self.arms.iter_mut().zip(strains) {
            arm.stop_in_time(*strain);
        }
    }
}

impl ArmUnit {
    fn stop_in_time(&mut self, strain: f64) {
        let Self { model, drive, state } = self;
        state.guard.end_frame(state.exchange.force(), strain, state.gripper.pose.translation, model.force_limit);
        // Commands of joints are not guarded.
        if matches!(state.wanted, Wanted::Setpoint(..)) && state.guard.must_stop(model.force_limit) {
            drive.halt();
            state.commanded = drive.reference().with_jaw(state.commanded.jaw());
            (state.guarded, state.held_back) = (true, true);
        }
    }
}
