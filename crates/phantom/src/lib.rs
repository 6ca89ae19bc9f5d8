//! Procedural anatomies with known truth, filmed by a simulated depth camera.

mod anatomy;
mod bed;
mod blend;
mod body;
mod error;
mod film;
mod folder;
mod instruments;
mod noise;
mod pack;
mod paint;
mod phantom_a;
mod phantom_b;
mod phantom_c;
mod plan;
mod record;
mod sensor;
mod stereo;
mod still;
mod tube;

#[cfg(test)]
mod tests;

pub use error::{Error, Result};
pub use folder::phantoms_folder;
pub use plan::NAMES;
pub use record::{RecordOptions, describe, record};
pub use sensor::Sensor;
