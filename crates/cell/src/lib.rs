//! Specimen and tools in one stepped world, and the scripted tasks in it.

mod error;
mod grasp_lift;
mod gripper;

pub use error::{Error, Result};
pub use grasp_lift::{GraspLift, GraspLiftRun, Sample, Snapshot, Summary};
pub use gripper::Gripper;
