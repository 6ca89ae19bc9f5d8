//! Procedural anatomies with known truth, filmed by a simulated depth camera.

mod anatomy;
mod bed;
mod error;
mod film;
mod instruments;
mod noise;
mod paint;
mod record;
mod sensor;
mod still;
mod tube;

#[cfg(test)]
mod tests;

pub use error::{Error, Result};
pub use record::{NAMES, RecordOptions, describe, record};
