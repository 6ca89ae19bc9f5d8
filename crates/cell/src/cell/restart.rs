//! Restarts an existing cell: arms elsewhere, tissue as it was saved, time zero.

use super::arm::ArmState;
use super::setpoint::Setpoint;
use super::{Cell, CellState, build};
use crate::{Error, Result};
use trocar_scene::{Port, Start};

impl Cell {
    /// The setpoint of arm `k` for the start pose `start`, as near as the limits allow; `port` is
    /// the scene's port of that arm.
    pub fn start_setpoint(&self, k: usize, start: &Start, port: Option<&Port>) -> Setpoint {
        let space = &self.arms[k].model.workspace;
        space.clamp(&build::start(start, port, space))
    }

    /// Restores the tissue of `state` without grasps and holes, puts the arms at rest at `starts`
    /// (one for each arm), and sets the time to zero. The same state and starts give the same bits,
    /// whatever the cell did before.
    ///
    /// # Errors
    /// A state of another cell, or a start out of an arm's reach. The cell then has to be restored
    /// or restarted.
    pub fn restart(&mut self, state: &CellState, starts: &[Setpoint]) -> Result<()> {
        if starts.len() != self.arms.len() {
            let (given, here) = (starts.len(), self.arms.len());
            return Err(Error::Option(format!("{given} starts; the cell has {here} arms")));
        }
        self.restore(state)?;
        self.world.state.holes.clear();
        for (arm, start) in self.arms.iter_mut().zip(starts) {
            arm.drive.restart(start)?;
            let tool = arm.model.tools.gripper;
            self.world.state.grasps.retain(|g| g.tool != tool);
            let (mut jaw, mut scissors) = (arm.state.jaw, arm.state.scissors);
            jaw.rest();
            scissors.rest();
            let (pose, design) = (arm.drive.tip(), arm.state.design);
            arm.state = ArmState::new(pose, &arm.model, *start, design, jaw, scissors);
        }
        self.waiting.0.clear();
        self.periods = 0;
        Ok(())
    }
}
