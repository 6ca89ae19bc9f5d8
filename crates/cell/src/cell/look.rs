//! Where the links of the arms are, for those who draw them.

use super::Cell;
use crate::Result;
use trocar_core::Pose;

impl Cell {
    /// Poses in the cell of an arm's base, of each of its links from the first that moves, and of its flange, as they are now.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn link_poses(&self, arm: &str) -> Result<Vec<Pose>> {
        let manipulator = &self.stations[self.arm_index(arm)?].manipulator;
        let (arm, q) = (manipulator.arm(), manipulator.measured_js().position);
        let frames = arm.frames(&q);
        let mut poses = vec![arm.base()];
        poses.extend((0..arm.dof()).map(|i| frames.link(i)));
        poses.push(frames.flange());
        Ok(poses)
    }

    /// Name of an arm's model, such as `fr3`.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn arm_model(&self, arm: &str) -> Result<&str> {
        Ok(self.stations[self.arm_index(arm)?].manipulator.arm().name())
    }
}
