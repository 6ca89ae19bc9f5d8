//! One cell repeats the tissue frames of another: for measuring the cost of contact.

use super::Cell;
use std::time::{Duration, Instant};
use trocar_tissue::{State, StepReport};

/// Positions and velocities of all nodes of a cell, and its grasps.
#[derive(Clone, Debug)]
pub struct Moment(State);

impl Cell {
    /// Positions and velocities of all nodes now, and the grasps.
    pub fn moment(&self) -> Moment {
        Moment(self.world.state.clone())
    }

    /// Repeats the last tissue frame of `other` from the moment `before` it: with the same
    /// positions, velocities and motions of tools, and with the contact forces on nodes at the
    /// frame's end as loads. So a cell without contact moves, frame by frame, like one with
    /// contact. Both cells must have the same specimen, uncut, and one tissue frame in a control
    /// period.
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
