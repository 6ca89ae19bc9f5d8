//! Restarts an existing cell: arms elsewhere, tissue as it was saved, time zero.

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
    /// (one for each arm), and sets the time to zero. A start in an organ is drawn back along the
    /// shaft until the instrument is out of it, as far as the workspace allows. The same state and
    /// starts give the same bits, whatever the cell did before.
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
        self.solids.holes.clear();
        self.solids.pinned.follow(&self.world);
        for (arm, start) in self.arms.iter_mut().zip(starts) {
            let tool = arm.model.tools.gripper;
            self.world.state.grasps.retain(|g| g.tool != tool);
            arm.begin(start, &self.world, &self.solids)?;
        }
        self.waiting.0.clear();
        self.periods = 0;
        Ok(())
    }
}
