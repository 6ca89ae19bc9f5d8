//! Specimen and tools in one stepped world, the two-arm cell around it, and the scripted tasks in
//! both.
//!
//! A [`World`] is a specimen in its own recording frame, in which a [`Session`] moves a free
//! gripper. A [`Cell`] is the whole of a scene file in the cell frame: it takes actions and reports
//! observations, and tissue feels and loads two dynamic arms in their ports.

pub mod blades;
mod calm;
mod cell;
mod cell_lift;
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
mod policy;
mod random_actions;
mod resection;
mod session;
mod severance;
mod target;
mod world;

pub use cell::{
    Action, ActionSpace, ArmObservation, Carried, Cell, CellEvent, CellReport, CellState, MOST_LOAD, Placed,
    ROLL_SPEED, SWING_SPEED, TIP_SPEED, TaggedForce, Timing, TissueObservation,
};
pub use cell_lift::{CellLift, CellLiftPolicy, CellLiftRun, CellLiftSample, CellLiftSummary};
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
pub use policy::Policy;
pub use random_actions::RandomActions;
pub use session::{Moment, Session};
pub use severance::{CutOrgan, Severance, SeveredPiece};
pub use world::{FRAME, Surroundings, VISCOSITY_TIME, World};
