//! One cell repeats the tissue frames of another, or holds what the other holds: for measuring the
//! cost of contact.

use super::Cell;
use crate::World;
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

    /// Holds the tissue that `other` holds. Call it after each control period of `other`. Tissue
    /// that `other` grasped in that period is grasped here too, at its place in this cell. Tissue
    /// that it released is released. So a cell whose instruments touch nothing, and whose jaws
    /// therefore never close on anything, lifts the same tissue. Both cells must have the same
    /// specimen, uncut.
    ///
    /// Friction alone ([`crate::GraspDesign::Friction`]) holds nothing without contact.
    pub fn hold_as(&mut self, other: &Self) {
        let World { model, state, .. } = &mut self.world;
        let theirs = &other.world.state;
        state.grasps.retain(|own| theirs.grasps.iter().any(|grasp| grasp.tool == own.tool && grasp.nodes == own.nodes));
        for grasp in &theirs.grasps {
            let arm = self.arms.iter().find(|arm| arm.model.tools.gripper == grasp.tool);
            if let Some(arm) = arm.filter(|_| state.grasps.iter().all(|own| own.tool != grasp.tool)) {
                let own = grasp.captured_in(model, theirs, state, &arm.state.gripper.pose);
                state.grasps.push(own);
            }
        }
    }

    /// Largest distance between a node of this cell and the same one of another (m).
    pub fn distance_from(&self, other: &Self) -> f64 {
        self.world.largest_motion_since(&other.world.state)
    }
}
