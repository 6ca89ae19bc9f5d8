//! Tissue at an instrument as a spring: what a haptic device needs between two frames of tissue.

use super::Cell;
use crate::{GraspDesign, Result};
use trocar_core::{Pose, Wrench};
use trocar_robot::wrench::ForceKind;

/// A local model of the tissue at an instrument, in the cell's axes and about the tip.
///
/// A haptic device works a thousand times a second, tissue sixty times. In between, the device
/// renders `wrench - stiffness * (motion of the tip since)` (Adachi, Kumano and Ogino 1995,
/// "Intermediate representation for stiff virtual objects").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HapticModel {
    /// Pose of the tip at the end of the last frame.
    pub tip: Pose,
    /// Force (N) and torque (N m) of tissue on the instrument then: contact and constraint.
    pub wrench: Wrench,
    /// Decrease of force and torque by translation (m) and rotation vector (rad) of the tip over a
    /// frame. Symmetric, and positive semidefinite up to rounding.
    pub stiffness: [[f64; 6]; 6],
}

impl Cell {
    /// The local model of the tissue at the instrument of `arm` after the last period. Calling it
    /// does not change the bits of later periods.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn haptic_model(&mut self, arm: &str) -> Result<HapticModel> {
        let k = self.arm_index(arm)?;
        let Self { arms, world, .. } = self;
        let unit = &arms[k];
        let tip = unit.state.gripper.pose;
        let tools = unit.model.tools;
        let tools = [tools.gripper, tools.blades[0], tools.blades[1]];
        let mut stiffness = world.stepper.tool_stiffness(&world.model, &world.state, &tools, tip.translation);
        // Nodes that follow the jaws exactly have no spring. The stiffness that earlier frames
        // showed takes its place.
        if unit.state.held.is_some() && matches!(unit.state.design, GraspDesign::RestPose | GraspDesign::LivePose) {
            (0..3).for_each(|c| stiffness[c][c] += unit.state.exchange.stiffness());
        }
        let wrench = unit.tissue_wrench(ForceKind::Contact) + unit.tissue_wrench(ForceKind::Constraint);
        Ok(HapticModel { tip, wrench, stiffness })
    }
}
