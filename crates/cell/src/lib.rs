//! Specimen and tools in one stepped world, and the scripted tasks in it.
//!
//! The world is the recording frame of the specimen for now: a scene file will place it in the two-arm cell.

pub mod blades;
mod calm;
mod clasp;
mod clusters;
mod cutter;
mod design;
mod error;
mod grasp_lift;
mod gripper;
mod hold;
mod jaw;
mod measure;
mod mouth;
mod phase;
mod resection;
mod session;
mod severance;
mod target;
mod world;

pub use clusters::{Cluster, clusters};
pub use cutter::{CUT_CLOSED, CUT_OPENED, Scissors};
pub use design::GraspDesign;
pub use error::{Error, Result};
pub use grasp_lift::{GraspLift, GraspLiftRun, SeverAt, Snapshot};
pub use gripper::{Gripper, MAX_ANGLE};
pub use jaw::{JAW_FORCE, Jaw};
pub use measure::{Sample, Summary};
pub use mouth::{CONTACT_SKIN, Mouth, Mouthful, attached};
pub use phase::Phase;
pub use session::Session;
pub use severance::{CutOrgan, Severance, SeveredPiece};
pub use world::{FRAME, Surroundings, VISCOSITY_TIME, World};
