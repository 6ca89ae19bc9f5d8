//! Another start for a cell that is there already: arms elsewhere, tissue as it was saved, time at
//! zero.

use super::station::Moving;
use super::{Cell, CellState, build};
use crate::{Error, Result};
use trocar_robot::instrument::Coordinates;
use trocar_scene::{Port, Start};

impl Cell {
    /// Coordinates of the arm at place `k` that stands as `start` says in the scene's `port`, as
    /// near as its limits let it.
    pub fn start_coordinates(&self, k: usize, start: &Start, port: &Port) -> Coordinates {
        let fixed = &self.stations[k].fixed;
        fixed.limits.clamp(&build::start(start, port, &fixed.port, &fixed.blades)).0
    }

    /// Takes the tissue and the grasp designs of `state`, lets go of all, puts the arms at rest at
    /// `starts`, one an arm, and begins at time zero. The same state and starts give the same bits
    /// whatever the cell did before.
    ///
    /// # Errors
    /// A state of another cell, or a start that an arm does not reach: the cell is then to be
    /// restored or restarted.
    pub fn restart(&mut self, state: &CellState, starts: &[Coordinates]) -> Result<()> {
        if starts.len() != self.stations.len() {
            let (given, here) = (starts.len(), self.stations.len());
            return Err(Error::Option(format!("{given} starts; the cell has {here} arms")));
        }
        self.restore(state)?;
        for (station, start) in self.stations.iter_mut().zip(starts) {
            station.manipulator.restart(start)?;
            let tool = station.fixed.tools.gripper;
            self.world.state.grasps.retain(|g| g.tool != tool);
            let (mut jaw, mut scissors) = (station.now.jaw, station.now.scissors());
            jaw.turn_to(0.0, 0.0);
            scissors.rest();
            let (pose, design) = (station.manipulator.measured_cp(), station.now.design);
            station.now = Moving::new(pose, &station.fixed, *start, design, jaw, scissors);
        }
        self.periods = 0;
        Ok(())
    }
}
