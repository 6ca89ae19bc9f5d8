//! What holds an organ, and how stiff it is, from measured grasp-lifts: a posterior.
//!
//! A [`LoneOrgan`] is lifted as the measured lifts were ([`SeenLift`], [`Observation`]), with many
//! values of its [`Parameter`](trocar_specimen::Parameter)s. [`Identification`] finds the values
//! that explain the lifts, and how well the lifts tell them ([`Identified`]).

mod alignment;
mod dense;
mod emulator;
mod error;
mod identification;
mod left_open;
mod lift_distance;
mod likelihood;
mod lone_organ;
mod observation;
mod prior;
mod pull_error;
mod quantile;
mod seen;
mod surrogate;
mod walkers;

pub use alignment::Alignment;
pub use error::{Error, Result};
pub use identification::{FINER, Identification, Identified};
pub use lift_distance::LiftDistance;
pub use lone_organ::{Grip, Lifted, LoneOrgan, Pace, Pull};
pub use observation::{Landmark, Observation};
pub use prior::default_priors;
pub use seen::SeenLift;
