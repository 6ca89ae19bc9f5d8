//! The cell: specimen and instruments, stepped together.
//!
//! A [`World`] is a specimen's tissue with its stepper. A [`Cell`] is everything in a scene file,
//! in the cell frame: it takes actions and reports observations. Its arms are driven by their
//! dynamics through ports, where tissue loads them, or are ideal and go where they are commanded.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod bite;
pub mod blades;
mod cell;
mod clusters;
mod cutter;
mod design;
mod error;
mod grasp_candidate;
mod gripper;
mod hold;
mod jaw;
mod jaw_region;
mod mesh_correction;
mod section;
mod severance;
mod target;
mod world;

pub use cell::{
    Action, ActionSpace, ArmObservation, Carried, Cell, CellEvent, CellReport, CellState, ContactParts, FreeSpace,
    HapticModel, MAX_LOAD, Moment, Placed, PortSpace, REACH_TOLERANCE, ROLL_SPEED, Reached, RuleCounts, SWING_SPEED,
    Setpoint, Settling, TIP_SPEED, TaggedForce, Timing, TissueObservation, ToolReach, Workspace, check_starts,
    tool_reach,
};
pub use clusters::{Cluster, clusters};
pub use cutter::{CUT_CLOSED, CUT_OPENED, Scissors};
pub use design::{GraspDesign, JawForces};
pub use error::{Error, Result};
pub use gripper::{Gripper, MAX_ANGLE};
pub use jaw::{JAW_FORCE, Jaw};
pub use jaw_region::{CONTACT_SKIN, JawRegion, TissueInJaws, attached};
pub use mesh_correction::element_material;
pub use severance::{Severance, SeveredPiece};
pub use target::reach_into;
pub use world::{FRAME, Surroundings, VISCOSITY_TIME, World, tissue_of};
