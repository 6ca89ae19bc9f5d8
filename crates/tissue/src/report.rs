//! The report of a frame: speeds, volumes, and the events that end a run.

use crate::Body;
use crate::shape::{STRETCH_LIMIT, Shape, ShapeMeter};
use crate::state::BodyState;

/// Speed at which a node has diverged (m/s): the paper's particle velocity limit.
pub const SPEED_LIMIT: f64 = 20.0;

/// Why a run is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Divergence {
    /// A position or velocity is not finite. The state is that of the last finite frame.
    NonFinite {
        /// The body.
        body: usize,
    },
    /// A node reached the speed limit of 20 m/s.
    OverSpeed {
        /// The body.
        body: usize,
    },
    /// The state or the model is not the one that the stepper was made for, or a grasp holds nodes
    /// that the model lacks. Nothing was stepped.
    OtherModel,
    /// A load is on a node that the model lacks, or not finite. Nothing was stepped.
    WrongLoad,
    /// An edge is longer than 10 times its rest length.
    OverStretch {
        /// The body.
        body: usize,
    },
    /// An integrator from outside this crate found no solution of a substep. The body is where the
    /// substep began.
    Unsolved {
        /// The body.
        body: usize,
    },
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OtherModel => write!(f, "the stepper or a grasp was made for another model"),
            Self::WrongLoad => write!(f, "a load is on a node that the model lacks, or its force is not finite"),
            Self::NonFinite { body } => write!(f, "body {body} has a position that is not finite"),
            Self::OverSpeed { body } => write!(f, "a node of body {body} is at the speed limit of {SPEED_LIMIT} m/s"),
            Self::Unsolved { body } => write!(f, "no minimum was found for body {body}"),
            Self::OverStretch { body } => {
                write!(f, "an edge of body {body} is over {STRETCH_LIMIT} times its rest length")
            }
        }
    }
}

/// The report of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Largest node speed at the end of the frame (m/s).
    pub max_speed: f64,
    /// Elements with signed volume at or below 0 at the end of the frame.
    pub inverted: usize,
    /// Smallest ratio of an element's volume to its rest volume.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the tool without inverting or overstretching
    /// an element. They catch up later.
    pub grasp_limited: usize,
    /// Iterations of all bodies and substeps: sweeps, or quasi-Newton steps.
    pub iterations: usize,
    /// Substeps in which the quasi-Newton search failed and sweeps took over, summed over bodies.
    pub fallbacks: usize,
    /// The event that ended the run, if any.
    pub divergence: Option<Divergence>,
}

impl Default for StepReport {
    fn default() -> Self {
        Self {
            max_speed: 0.0,
            inverted: 0,
            min_volume_ratio: f64::INFINITY,
            grasp_limited: 0,
            iterations: 0,
            fallbacks: 0,
            divergence: None,
        }
    }
}

impl StepReport {
    /// The sum of both.
    pub(crate) fn with(self, other: &Self) -> Self {
        Self {
            max_speed: self.max_speed.max(other.max_speed),
            inverted: self.inverted + other.inverted,
            min_volume_ratio: self.min_volume_ratio.min(other.min_volume_ratio),
            grasp_limited: self.grasp_limited + other.grasp_limited,
            iterations: self.iterations + other.iterations,
            fallbacks: self.fallbacks + other.fallbacks,
            divergence: match (self.divergence, other.divergence) {
                // It is the reason why the state was restored.
                (_, Some(lost @ Divergence::NonFinite { .. })) => Some(lost),
                (first, second) => first.or(second),
            },
        }
    }

    /// Adds the measures of a body at the end of the frame: speed, volumes, and the events that end
    /// a run.
    pub(crate) fn measure(&mut self, index: usize, body: &Body, state: &BodyState, meter: &mut ShapeMeter) {
        let Shape { finite, inverted, min_volume_ratio, stretched } = meter.measure(body, state);
        if !finite || !state.v.iter().all(|v| v.is_finite()) {
            let divergence = Some(Divergence::NonFinite { body: index });
            *self = Self { max_speed: 0.0, inverted: 0, min_volume_ratio: f64::INFINITY, divergence, ..*self };
            return;
        }
        let fastest = state.v[..body.len()].iter().map(|v| v.length_squared()).fold(0.0, f32::max);
        let max_speed = f64::from(fastest).sqrt();
        let divergence = if max_speed >= SPEED_LIMIT {
            Some(Divergence::OverSpeed { body: index })
        } else if stretched {
            Some(Divergence::OverStretch { body: index })
        } else {
            self.divergence
        };
        *self = Self { max_speed, inverted, min_volume_ratio, divergence, ..*self };
    }
}
