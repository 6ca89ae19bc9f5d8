//! Reads and commands of one arm, in the words of the Collaborative Robotics Toolkit (CRTK). Commands are taken at once and carried out by [`Cell::advance`] or the next [`Cell::step`].

use super::Cell;
use super::report::TaggedForce;
use super::station::{Station, Wanted};
use crate::{Error, GraspDesign, Gripper, Result};
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::instrument::{Coordinates, Limits};
use trocar_robot::manipulator::JointReadings;
use trocar_robot::port::{Port, Solution};

impl Cell {
    fn place(&self, arm: &str) -> Result<usize> {
        self.stations.iter().position(|s| s.fixed.side.name() == arm).ok_or_else(|| Error::UnknownArm {
            name: arm.chars().take(60).collect(),
            known: self.stations.iter().map(|s| s.fixed.side.name()).collect::<Vec<_>>().join(", "),
        })
    }

    pub(super) fn arm(&self, arm: &str) -> Result<&Station> {
        Ok(&self.stations[self.place(arm)?])
    }

    fn arm_mut(&mut self, arm: &str) -> Result<&mut Station> {
        let k = self.place(arm)?;
        Ok(&mut self.stations[k])
    }

    /// The place of an arm in observations and actions.
    ///
    /// # Errors
    /// An arm that is not there, as all of these.
    pub fn arm_index(&self, arm: &str) -> Result<usize> {
        self.place(arm)
    }

    /// Measured joints.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn measured_js(&self, arm: &str) -> Result<JointReadings> {
        Ok(self.arm(arm)?.manipulator.measured_js())
    }

    /// Measured pose of the tip frame in the cell.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn measured_cp(&self, arm: &str) -> Result<Pose> {
        Ok(self.arm(arm)?.manipulator.measured_cp())
    }

    /// What a sensor at the tool mount reads, in the mount's frame, weight and inertia of the instrument included; tagged with what the tissue's part of it is.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn measured_cf(&self, arm: &str) -> Result<TaggedForce> {
        let station = self.arm(arm)?;
        Ok(TaggedForce { kind: station.force_kind(), wrench: station.manipulator.measured_cf() })
    }

    /// The instrument with its jaws as tissue meets it.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn gripper(&self, arm: &str) -> Result<Gripper> {
        Ok(self.arm(arm)?.now.gripper)
    }

    /// What was commanded last.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn setpoint(&self, arm: &str) -> Result<Coordinates> {
        Ok(self.arm(arm)?.now.commanded)
    }

    /// How far an instrument may go.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn limits(&self, arm: &str) -> Result<Limits> {
        Ok(self.arm(arm)?.fixed.limits)
    }

    /// The port of an arm.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn port(&self, arm: &str) -> Result<Port> {
        Ok(self.arm(arm)?.fixed.port)
    }

    /// The joints' positions that an arm never leaves, lowest and highest by joint [rad or m].
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn joint_limits(&self, arm: &str) -> Result<Vec<[f64; 2]>> {
        let chain = self.arm(arm)?.manipulator.arm();
        Ok(chain.segments().iter().map(|s| s.joint.limits.position).collect())
    }

    /// The nearest coordinates to a pose of the tip in the cell, and what of the pose they do not meet.
    ///
    /// # Errors
    /// An arm that is not there, a pose that is none.
    pub fn solve(&self, arm: &str, tip: &Pose, near: &Coordinates) -> Result<Solution> {
        self.arm(arm)?.solve(tip, near)
    }

    /// Moves the tip to a pose in the cell as near as the port lets it; the jaw stays as it was told. The solution has the rotation that was rejected.
    ///
    /// # Errors
    /// An arm that is not there, a pose that is none.
    pub fn servo_cp(&mut self, arm: &str, tip: &Pose) -> Result<Solution> {
        let station = self.arm_mut(arm)?;
        let near = Coordinates { jaw: station.now.wanted_jaw(), ..station.now.commanded };
        let solution = station.solve(tip, &near)?;
        station.now.wanted = Wanted::Coordinates(solution.coordinates, solution.rejected_rotation);
        Ok(solution)
    }

    /// Moves the joints, whatever the port says to it; the jaw stays as it was told.
    ///
    /// # Errors
    /// An arm that is not there, not a number a joint, one that is not finite. Nothing has changed then.
    pub fn servo_jp(&mut self, arm: &str, joints: &[f64]) -> Result<()> {
        let station = self.arm_mut(arm)?;
        station.manipulator.servo_jp(joints)?;
        station.now.wanted = Wanted::Joints(station.now.wanted_jaw());
        Ok(())
    }

    /// Moves the jaw towards an opening, 0 closed to 1. Closing, it stops where tissue pushes back with its force.
    ///
    /// # Errors
    /// An arm that is not there, an opening that is none.
    pub fn servo_jaw(&mut self, arm: &str, opening: f64) -> Result<()> {
        if !(0.0..=1.0).contains(&opening) {
            return Err(Error::Option(format!("jaw of the {arm} arm is {opening}; 0 (closed) to 1 (open)")));
        }
        self.arm_mut(arm)?.now.set_wanted_jaw(opening);
        Ok(())
    }

    /// How an arm's jaws hold what they close on from now on.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn set_grasp_design(&mut self, arm: &str, design: GraspDesign) -> Result<()> {
        self.arm_mut(arm)?.now.design = design;
        Ok(())
    }

    /// How an arm's jaws hold what they close on.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn grasp_design(&self, arm: &str) -> Result<GraspDesign> {
        Ok(self.arm(arm)?.now.design)
    }

    /// Organ, organ coordinate and centroid [m, cell frame] of what an arm's jaws hold.
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn held(&self, arm: &str) -> Result<Option<(usize, f64, DVec3)>> {
        let station = self.arm(arm)?;
        Ok(station.now.held.as_ref().map(|h| (h.organ, h.s, h.hold.now(&self.world))))
    }

    /// The organ between an arm's blades, if any is (SPEC C3).
    ///
    /// # Errors
    /// An arm that is not there.
    pub fn in_mouth(&self, arm: &str) -> Result<Option<usize>> {
        Ok(self.arm(arm)?.tissue(&self.world).map(|(organ, _)| organ))
    }
}
