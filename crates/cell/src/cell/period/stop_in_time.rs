//! Stage 7: the force guard reads the load of the frame, and stops an arm that would exceed its
//! limit.

use crate::World;
use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Wanted};
use crate::cell::rules::{TissueAtArm, hit_ahead, load, place};
use glam::DVec3;

impl Cell {
    /// `tissue`: the strain of the tissue at each arm.
    pub(super) fn stop_in_time(&mut self, tissue: &[TissueAtArm]) {
        for (arm, tissue) in self.arms.iter_mut().zip(tissue) {
            arm.stop_in_time(&self.world, *tissue);
        }
    }
}

impl ArmUnit {
    fn stop_in_time(&mut self, world: &World, tissue: TissueAtArm) {
        let Self { model, drive, state } = self;
        let pose = state.gripper.pose;
        let shaft = pose.rotation * DVec3::X;
        // A roll does not give way to solids: instruments that meet push each other aside.
        let loads = [load(state.exchange.wrench(), shaft), state.solid.force().extend(0.0)];
        let at = place(pose.translation, drive.measured().0.roll());
        let sent = drive.reference();
        let reference = place(model.workspace.tip(&sent).translation, sent.roll());
        state.guard.end_frame(loads, tissue, [at, reference], model.force_limit);
        if model.force_limit.is_finite() {
            let hit = hit_ahead(world, self, self.state.guard.motion());
            self.state.guard.expect(hit);
        }
        let Self { model, drive, state } = self;
        // Commands of joints are not guarded.
        if matches!(state.wanted, Wanted::Setpoint(..)) && state.guard.must_stop(model.force_limit) {
            drive.halt();
            state.commanded = drive.reference().with_jaw(state.commanded.jaw());
            (state.guarded, state.held_back) = (true, true);
        }
    }
}
