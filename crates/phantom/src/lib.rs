//! Procedural anatomies with known truth, filmed by a simulated depth camera.

mod error;
mod record;

pub use error::{Error, Result};
pub use record::{RecordOptions, record};
