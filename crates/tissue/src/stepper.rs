//! One frame of simulation.

use crate::{Model, Schedule, State, ToolMotion};

/// Why a run is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Divergence {
    /// A position or velocity is not finite.
    NonFinite {
        /// The body.
        body: usize,
    },
    /// A node reached the speed limit of 20 m/s.
    OverSpeed {
        /// The body.
        body: usize,
    },
    /// An edge is longer than 10 times its rest length.
    OverStretch {
        /// The body.
        body: usize,
    },
}

/// What happened in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Largest node speed at the end of the frame [m/s].
    pub max_speed: f64,
    /// Elements with signed volume at or below 0 at the end of the frame.
    pub inverted: usize,
    /// Smallest ratio of an element's volume to its rest volume.
    pub min_volume_ratio: f64,
    /// The event that ended the run, if any.
    pub divergence: Option<Divergence>,
}

/// Advances states of one model; owns all scratch memory, so stepping allocates nothing.
pub struct Stepper {}

impl Stepper {
    /// Prepares scratch memory and `threads` worker threads (0: as many as the machine has). The result does not depend on
    /// the number of threads.
    pub fn new(model: &Model, schedule: Schedule, threads: usize) -> Self {
        let _ = (model, schedule, threads);
        todo!()
    }

    /// Advances `state` by one frame of `dt` [s]. `tool` is the motion of the tool that holds the state's grasp.
    pub fn step(&mut self, model: &Model, state: &mut State, dt: f64, tool: Option<&ToolMotion>) -> StepReport {
        let _ = (model, state, dt, tool);
        todo!()
    }
}
