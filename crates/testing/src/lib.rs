//! Shared parts of tests and benchmarks: damaged files for every reader ([`fuzz_reader`]), and with
//! the feature `scenes` scenes to step and draw.

mod damage;
mod fuzz;
mod peak;
#[cfg(feature = "scenes")]
pub mod scenes;

pub use damage::damage;
pub use fuzz::{Allowance, cases, fuzz_reader};
pub use peak::{PEAK, Peak};
