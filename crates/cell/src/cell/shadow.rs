//! One cell does the tissue frames of another: for measuring what contact costs.

use super::Cell;
use std::time::{Duration, Instant};
use trocar_tissue::{State, StepReport};

/// Where all nodes of a cell are and how fast, and what is held.
#[derive(Clone, Debug)]
pub struct Moment(State);

impl Cell {
    /// Where all nodes are and how fast, and what is held.
    pub fn moment(&self) -> Moment {
        Moment(self.world.state.clone())
    }

    /// Does the last tissue frame of `other` from the moment `before` it: from the same places and
    /// velocities, with the same motions of the tools, under the forces that contact did to nodes
    /// at its end. So a cell without contact moves, frame by frame, as one that has it. For cells
    /// of one specimen, neither of them cut, with one tissue frame a control period.
    ///
    /// Returns the report and the wall time of the step.
    pub fn shadow(&mut self, other: &Self, before: &Moment) -> (StepReport, Duration) {
        self.world.state.copy_motion(&before.0);
        self.world.state.grasps.clone_from(&before.0.grasps);
        let loads = other.world.contact_loads();
        let clock = Instant::now();
        let report = self.world.step_under(&other.motions, &loads);
        (report, clock.elapsed())
    }

    /// Largest distance between a node of this cell and the same one of another (m).
    pub fn distance_from(&self, other: &Self) -> f64 {
        self.world.largest_motion_since(&other.world.state)
    }
}
