//! Forces at the tool mount: what an instrument weighs is identified and taken off.
//!
//! A six-axis sensor at the mount carries an instrument of 4.7 N; tissue pulls with tens of
//! millinewtons. So the weight must be known to a percent and its share at every orientation taken
//! off. [`LoadModel`] is what the sensor reads when nothing is touched, [`identify`] finds it from
//! readings at rest, [`Compensator`] takes it off, tared at reset, and says how uncertain what is
//! left is.
//!
//! All of it is static: where an arm accelerates, the instrument's inertia is in the reading too.

mod compensate;
mod identify;
mod load;
mod poses;
mod svd;

pub use compensate::{Compensator, ForceReading};
pub use identify::{Identification, StaticReading, identify};
pub use load::{ForceKind, LoadModel, PARAMETERS, SensorNoise};
pub use poses::{STATIC_POSES, STATIC_TILT, static_orientations};
