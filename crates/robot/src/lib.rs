//! Robot arms as dynamic serial chains, laparoscopic instruments, the ports that they work through,
//! and their control.
//!
//! Knows nothing of tissue, cameras or files of scenes. SI units and radians; all in double
//! precision.

pub mod chain;
mod error;
pub mod instrument;
pub mod manipulator;
pub mod port;
pub mod wrench;

pub use error::{Error, Result};
