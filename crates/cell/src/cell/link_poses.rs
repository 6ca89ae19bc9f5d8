//! Poses of the arms' links, for pictures.

use super::Cell;
use crate::Result;
use trocar_core::Pose;
use trocar_robot::manipulator::Manipulator;

impl Cell {
    /// Poses in the cell of an arm's base, of each of its links from the first that moves, and of
    /// its flange, as they are now. Empty for an ideal arm.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn link_poses(&self, arm: &str) -> Result<Vec<Pose>> {
        let Some(manipulator) = self.arm(arm)?.drive.manipulator() else { return Ok(Vec::new()) };
        let (arm, q) = (manipulator.arm(), manipulator.measured_js().position);
        let frames = arm.frames(&q);
        let mut poses = vec![arm.base()];
        poses.extend((0..arm.dof()).map(|i| frames.link(i)));
        poses.push(frames.flange());
        Ok(poses)
    }

    /// Name of an arm's model, such as `fr3`; `ideal` for an ideal arm.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn arm_model(&self, arm: &str) -> Result<&str> {
        let manipulator = self.arm(arm)?.drive.manipulator().map(Manipulator::arm);
        Ok(manipulator.map_or("ideal", |arm| arm.name()))
    }
}
