//! Damaged files for the tests of every reader: [`fuzz_reader`].

mod damage;
mod fuzz;
mod peak;

pub use damage::damage;
pub use fuzz::{Allowance, cases, fuzz_reader};
pub use peak::{PEAK, Peak};
