//! Shared parts of tests of several crates: damaged files for readers ([`fuzz_reader`]), and small
//! bodies, specimens and recordings.

pub mod blocks;
mod damage;
mod fuzz;
mod peak;
pub mod sphere;
mod tools;
pub mod tube;

pub use damage::damage;
pub use fuzz::{Allowance, cases, fuzz_reader};
pub use peak::{PEAK, Peak};
pub use tools::python_with;
