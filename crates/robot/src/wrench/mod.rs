//! Forces at the tool mount: identification and compensation of an instrument's weight.
//!
//! A six-axis sensor at the mount carries an instrument of 4.7 N; tissue pulls with tens of
//! millinewtons. So the weight must be known to a percent and subtracted in every orientation.
//! [`LoadModel`] is the reading without contact, [`identify`] estimates it from readings at rest,
//! and [`Compensator`] subtracts it, tared at reset, with the uncertainty of the rest.
//!
//! The model is static: if the arm accelerates, readings contain the instrument's inertia.

mod compensate;
mod identify;
mod load;
mod poses;
mod svd;

pub use compensate::{Compensator, ForceReading};
pub use identify::{Identification, StaticReading, identify};
pub use load::{ForceKind, LoadModel, PARAMETERS, SensorNoise};
pub use poses::{STATIC_POSES, STATIC_TILT, static_orientations};
