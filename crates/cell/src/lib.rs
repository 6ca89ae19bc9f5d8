//! Specimen and tools in one stepped world, and the scripted tasks in it.
//!
//! The world is the recording frame of the specimen for now: a scene file will place it in the two-arm cell.

mod clusters;
mod error;
mod grasp_lift;
mod gripper;
mod measure;
mod target;
mod world;

pub use clusters::{Cluster, clusters};
pub use error::{Error, Result};
pub use grasp_lift::{GraspLift, GraspLiftRun, Phase, Snapshot};
pub use gripper::Gripper;
pub use measure::{Sample, Summary};
pub use world::{FRAME, VISCOSITY_TIME, World};
