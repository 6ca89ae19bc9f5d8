//! Robot arms as dynamic serial chains, laparoscopic instruments, their ports, and their control.
//!
//! This crate does not depend on tissue, cameras or scene files. It uses SI units and radians, in
//! double precision.
//!
//! ```
//! use trocar_robot::chain::SerialArm;
//!
//! // The torques that hold a Franka Research 3 against gravity in its home posture.
//! let arm = SerialArm::franka_fr3()?;
//! let torque = arm.gravity_torque(&arm.home());
//! assert!(torque.iter().all(|t| t.abs() < 87.0));
//! # Ok::<(), trocar_robot::Error>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

pub mod chain;
mod error;
pub mod instrument;
pub mod manipulator;
pub mod port;
pub mod wrench;

pub use error::{Error, Result};
