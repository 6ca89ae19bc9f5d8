//! One arm of the cell: its drive, its instrument in the tissue, and its grasp.

mod begin;
mod jaws;
mod shears;
mod state;
mod tissue_query;

pub(super) use shears::Sheared;
pub(super) use state::{ArmState, Held, Wanted};

use super::drive::Drive;
use super::workspace::Workspace;
use crate::GraspDesign;
use crate::blades::{Blades, Tools};
use trocar_robot::wrench::ForceKind;
use trocar_scene::{InstrumentKind, Side};
use trocar_tissue::Collider;

/// The constant part of an arm.
#[derive(Clone, Debug)]
pub(super) struct ArmModel {
    pub side: Side,
    pub kind: InstrumentKind,
    pub workspace: Workspace,
    pub tools: Tools,
    pub blades: Blades,
    /// The convex parts that tissue touches.
    pub parts: Vec<Collider>,
    /// Limit of the force guard (N).
    pub force_limit: f64,
    /// Force of solids at which an ideal arm stops (N).
    pub stop_force: f64,
    /// Force with which the instrument has to press on an organ to puncture it (N).
    pub puncture_force: f64,
    /// RCM deviations that are reported (m): the scene's threshold, and the limit at which hardware
    /// stops.
    pub rcm_limits: [f64; 2],
    /// Pull at which tissue tears out of a compliant grasp (N).
    pub tear_force: f64,
    /// Length of a control period (s).
    pub period: f64,
    /// How the jaws hold after the first grasp.
    pub design: GraspDesign,
}

/// One arm.
#[derive(Clone, Debug)]
pub(super) struct ArmUnit {
    pub model: ArmModel,
    pub drive: Drive,
    pub state: ArmState,
}

impl ArmUnit {
    /// Jaw opening, 0 closed to 1.
    pub fn opening(&self) -> f64 {
        self.state.gripper.jaw_angle / self.model.blades.max_angle
    }

    /// The kind of the tissue's force: contact, or the constraint of a latched grasp.
    pub fn force_kind(&self) -> ForceKind {
        match &self.state.held {
            Some(_) if self.state.design != GraspDesign::Friction => ForceKind::Constraint,
            _ => ForceKind::Contact,
        }
    }
}
