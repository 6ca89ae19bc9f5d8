//! Reads and commands of one arm, with the names of the Collaborative Robotics Toolkit (CRTK). The
//! next [`Cell::step`] executes a command.

use super::Cell;
use super::arm::{ArmUnit, Wanted};
use super::report::TaggedForce;
use super::setpoint::Setpoint;
use super::workspace::{Reached, Workspace};
use crate::{Error, Gripper, Result};
use glam::DVec3;
use trocar_core::Pose;
use trocar_core::Wrench;
use trocar_robot::manipulator::JointReadings;

impl Cell {
    pub(super) fn arm(&self, arm: &str) -> Result<&ArmUnit> {
        Ok(&self.arms[self.arm_index(arm)?])
    }

    fn arm_mut(&mut self, arm: &str) -> Result<&mut ArmUnit> {
        let k = self.arm_index(arm)?;
        Ok(&mut self.arms[k])
    }

    /// The index of an arm in observations and actions.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn arm_index(&self, arm: &str) -> Result<usize> {
        self.arms.iter().position(|s| s.model.side.name() == arm).ok_or_else(|| Error::UnknownArm {
            name: arm.chars().take(60).collect(),
            known: self.arms.iter().map(|s| s.model.side.name()).collect::<Vec<_>>().join(", "),
        })
    }

    /// Measured joints.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn measured_js(&self, arm: &str) -> Result<JointReadings> {
        self.arm(arm)?.drive.joints().ok_or_else(|| no_joints(arm))
    }

    /// Measured pose of the tip frame in the cell.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn measured_cp(&self, arm: &str) -> Result<Pose> {
        Ok(self.arm(arm)?.drive.tip())
    }

    /// The reading of a sensor at the tool mount, in the mount's frame, with the instrument's
    /// weight and inertia; tagged with the kind of the tissue's part.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn measured_cf(&self, arm: &str) -> Result<TaggedForce> {
        let unit = self.arm(arm)?;
        let kind = unit.force_kind();
        let wrench = match unit.drive.manipulator() {
            Some(manipulator) => manipulator.measured_cf(),
            None => {
                let to_tip = unit.drive.tip().rotation.inverse();
                let Wrench { force, torque } = unit.tissue_wrench(kind);
                Wrench { force: to_tip * force, torque: to_tip * torque }
            }
        };
        Ok(TaggedForce { kind, wrench })
    }

    /// The instrument's gripper, as it touches tissue.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn gripper(&self, arm: &str) -> Result<Gripper> {
        Ok(self.arm(arm)?.state.gripper)
    }

    /// The last command.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn setpoint(&self, arm: &str) -> Result<Setpoint> {
        Ok(self.arm(arm)?.state.commanded)
    }

    /// The workspace of an instrument, and the meaning of its arm's numbers.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn workspace(&self, arm: &str) -> Result<&Workspace> {
        Ok(&self.arm(arm)?.model.workspace)
    }

    /// The joints' positions that an arm never leaves, lowest and highest by joint (rad or m).
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn joint_limits(&self, arm: &str) -> Result<Vec<[f64; 2]>> {
        let Some(manipulator) = self.arm(arm)?.drive.manipulator() else { return Ok(Vec::new()) };
        Ok(manipulator.arm().segments().iter().map(|s| s.joint.limits.position).collect())
    }

    /// The reachable pose nearest to a pose of the tip frame.
    ///
    /// # Errors
    /// An arm that the cell does not have, or an invalid pose.
    pub fn solve(&self, arm: &str, tip: &Pose, near: &Setpoint) -> Result<Reached> {
        self.arm(arm)?.model.workspace.solve(tip, near)
    }

    /// Moves the tip to the reachable pose nearest to a pose in the cell; the jaw's command stays.
    /// The result has the rejected rotation.
    ///
    /// # Errors
    /// An arm that the cell does not have, or an invalid pose.
    pub fn servo_cp(&mut self, arm: &str, tip: &Pose) -> Result<Reached> {
        let unit = self.arm_mut(arm)?;
        let near = unit.state.commanded.with_jaw(unit.state.wanted.jaw());
        let reached = unit.model.workspace.solve(tip, &near)?;
        unit.state.wanted = Wanted::Setpoint(reached.setpoint, reached.rejected_rotation);
        Ok(reached)
    }

    /// Moves the joints without regard to the port. The jaw's command stays.
    ///
    /// # Errors
    /// An arm that the cell does not have or that has no joints, a wrong count of numbers, or one
    /// that is not finite. Nothing has changed then.
    pub fn servo_jp(&mut self, arm: &str, joints: &[f64]) -> Result<()> {
        let unit = self.arm_mut(arm)?;
        if !unit.drive.command_joints(joints)? {
            return Err(no_joints(arm));
        }
        unit.state.wanted = Wanted::Joints(unit.state.wanted.jaw());
        Ok(())
    }

    /// Moves the jaw towards an opening, from 0 (closed) to 1. A closing jaw stops where tissue
    /// pushes back with the jaw's force.
    ///
    /// # Errors
    /// An arm that the cell does not have, an opening out of range.
    pub fn servo_jaw(&mut self, arm: &str, opening: f64) -> Result<()> {
        if !(0.0..=1.0).contains(&opening) {
            return Err(Error::Option(format!("jaw of the {arm} arm is {opening}; 0 (closed) to 1 (open)")));
        }
        self.arm_mut(arm)?.state.wanted.set_jaw(opening);
        Ok(())
    }

    /// Organ, organ coordinate and centroid (m, cell frame) of the tissue that an arm's jaws hold.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn held(&self, arm: &str) -> Result<Option<(usize, f64, DVec3)>> {
        let unit = self.arm(arm)?;
        Ok(unit.state.held.as_ref().map(|h| (h.organ, h.s, h.hold.now(&self.world))))
    }

    /// The organ between an arm's blades, if there is one.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn in_jaws(&self, arm: &str) -> Result<Option<usize>> {
        Ok(self.arm(arm)?.tissue(&self.world).map(|(organ, _)| organ))
    }
}

fn no_joints(arm: &str) -> Error {
    Error::Option(format!("the {arm} arm is ideal (drive = \"ideal\" in the scene): it has no joints"))
}
