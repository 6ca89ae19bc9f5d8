//! What tests and benchmarks share: damaged files for every reader ([`assault`]), and with the feature `scenes` the scenes
//! that are stepped and drawn (`scenes`).

mod assault;
mod damage;
mod peak;
#[cfg(feature = "scenes")]
pub mod scenes;

pub use assault::{Allowance, assault, cases};
pub use damage::damage;
pub use peak::{PEAK, Peak};
