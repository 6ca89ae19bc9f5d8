//! A physics step of all arms among solids.
//!
//! Ideal arms move first, as far as solids let them. Then arms with dynamics step, the left one
//! first. Between two of them one spring acts. A trial step shows the right arm's motion without
//! the spring. From there the spring pushes the left arm in its implicit step, softened by the mass
//! that the right arm has at that place. Then the right arm steps with exactly the opposite force.

use super::Solids;
use super::meeting::{Deepest, Meeting};
use super::pair::meetings;
use super::rod::Rod;
use super::spring::Spring;
use crate::Result;
use crate::cell::arm::ArmUnit;
use crate::cell::drive::Drive;
use crate::cell::speeds::TIP_SPEED;
use glam::DVec3;
use trocar_core::{Pose, Wrench};
use trocar_robot::manipulator::{MAX_OBSTACLES, Obstacle};

/// Largest speed of an ideal arm (m/s): twice that of actions.
const MAX_SPEED: f64 = 2.0 * TIP_SPEED;

/// A solid that is not touched yet counts in a step if it would be touched within this many steps.
const AHEAD: f64 = 2.0;

/// Bisections of the way of an ideal arm that solids stop.
const STOP_BISECTIONS: usize = 10;

impl ArmUnit {
    fn is_ideal(&self) -> bool {
        matches!(self.drive, Drive::Ideal(_))
    }

    /// The motion of the instrument in the next physics step of `dt` (s) if no solid pushes it, in
    /// the cell; none for an ideal arm, which has moved already.
    fn free_motion(&mut self, dt: f64) -> Result<Pose> {
        if self.is_ideal() {
            return Ok(Pose::IDENTITY);
        }
        let (drive, state) = (self.drive.state(), self.state.clone());
        let from = self.drive.tip();
        self.step(Wrench::default(), &mut [], dt)?;
        let to = self.drive.tip();
        self.drive.restore(&drive)?;
        self.state = state;
        let rotation = to.rotation * from.rotation.inverse();
        Ok(Pose { rotation, translation: to.translation - rotation * from.translation })
    }
}

impl Solids {
    /// Steps `arms` by `dt` (s).
    pub fn step(&self, arms: &mut [ArmUnit], dt: f64) -> Result<()> {
        for k in 0..arms.len() {
            if arms[k].is_ideal() {
                self.move_ideal(arms, k, dt)?;
            }
        }
        // Force (N) and torque about the cell's origin (N m) of meetings that another arm has
        // found.
        let mut given = vec![Wrench::default(); arms.len()];
        for k in 0..arms.len() {
            if !arms[k].is_ideal() {
                self.step_dynamic(arms, k, &mut given, dt)?;
            }
        }
        for k in 0..arms.len() {
            if arms[k].is_ideal() {
                let tip = arms[k].drive.tip();
                for meeting in self.still(&arms[k], &arms[k].rods_at(tip)) {
                    arms[k].state.pressed.add(&meeting, Spring::at(meeting.gap, meeting.room).force());
                }
                let own = self.force_at(arms, k, tip, false);
                arms[k].state.solid.add(own + given[k].force);
            }
        }
        Ok(())
    }

    /// The meetings of `arm`, whose rods are given, with all but other instruments.
    pub(in crate::cell) fn still(&self, arm: &ArmUnit, rods: &[Rod]) -> Vec<Meeting> {
        let mut found = Vec::new();
        if let Some(height) = self.bed.filter(|_| arm.model.workspace.as_port().is_some()) {
            let mut deepest = Deepest::default();
            super::bed::meet(height, rods, &mut deepest);
            found.extend(deepest.into_iter());
        }
        // Blades that shear push no tissue.
        let shaft_only = arm.state.shears.is_some();
        let felt = |rod: &&Rod| !shaft_only || rod.part == 0;
        let mut deepest = Deepest::default();
        let rods: Vec<Rod> = rods.iter().filter(felt).copied().collect();
        self.pinned.meet(&rods, &self.holes, arm.model.tools.gripper, &mut deepest);
        found.extend(deepest.into_iter());
        found
    }

    /// The force at rest (N) of solids on arm `k` with its tip frame at `tip`; other arms with
    /// dynamics count if `all`.
    fn force_at(&self, arms: &[ArmUnit], k: usize, tip: Pose, all: bool) -> DVec3 {
        let rods = arms[k].rods_at(tip);
        let mut found = self.still(&arms[k], &rods);
        for (j, other) in arms.iter().enumerate() {
            if j != k && (all || other.is_ideal()) {
                found.extend(meetings(&rods, &other.rods_at(other.drive.tip())));
            }
        }
        found.iter().map(|m| Spring::at(m.gap, m.room).force() * m.normal).sum()
    }

    /// Moves ideal arm `k` until solids push it with the force limit, or no more than before.
    fn move_ideal(&self, arms: &mut [ArmUnit], k: usize, dt: f64) -> Result<()> {
        let before = arms[k].drive.tip();
        let saved = arms[k].drive.state();
        arms[k].step(Wrench::default(), &mut [], dt)?;
        let way = arms[k].drive.tip().translation.distance(before.translation);
        // An arm that was stopped while its command continued is far behind. It must not jump over
        // a solid.
        let most = (MAX_SPEED * dt / way).min(1.0);
        if most < 1.0 {
            arms[k].drive.restore(&saved)?;
            arms[k].drive.step_part(most, dt);
        }
        let force = |arms: &[ArmUnit], tip: Pose| self.force_at(arms, k, tip, true).length();
        let limit = arms[k].model.stop_force;
        let pushed = force(arms, arms[k].drive.tip());
        if pushed <= limit {
            return Ok(());
        }
        let allowed = limit.max(force(arms, before));
        if pushed <= allowed {
            return Ok(());
        }
        let (mut low, mut high) = (0.0, most);
        for _ in 0..STOP_BISECTIONS {
            let share = 0.5 * (low + high);
            arms[k].drive.restore(&saved)?;
            arms[k].drive.step_part(share, dt);
            if force(arms, arms[k].drive.tip()) <= allowed { low = share } else { high = share }
        }
        arms[k].drive.restore(&saved)?;
        arms[k].drive.step_part(low, dt);
        arms[k].state.held_back = true;
        Ok(())
    }

    fn step_dynamic(&self, arms: &mut [ArmUnit], k: usize, given: &mut [Wrench], dt: f64) -> Result<()> {
        let tip = arms[k].drive.tip();
        let rods = arms[k].rods_at(tip);
        let still = self.still(&arms[k], &rods).into_iter().map(|m| (m, None));
        let mut found: Vec<(Meeting, Option<usize>)> = still.collect();
        for (j, other) in arms.iter().enumerate() {
            // If both arms have dynamics, the first one finds their meetings.
            if other.is_ideal() || j > k {
                found.extend(meetings(&rods, &other.rods_at(other.drive.tip())).map(|m| (m, Some(j))));
            }
        }
        found.retain(|(m, other)| m.gap < 0.0 || m.gap < AHEAD * dt * closing_speed(arms, k, m, *other));
        // The sort is stable: equal ones keep their order.
        found.sort_by(|a, b| a.0.gap.total_cmp(&b.0.gap));
        found.truncate(MAX_OBSTACLES);
        let mut free = vec![None; arms.len()];
        for (_, other) in &found {
            if let Some(j) = *other
                && free[j].is_none()
            {
                free[j] = Some(arms[j].free_motion(dt)?);
            }
        }
        let obstacle = |(meeting, other): &(Meeting, Option<usize>)| {
            let motion = other.and_then(|j| free[j]).unwrap_or_default();
            let manipulator = other.and_then(|j| arms[j].drive.manipulator());
            let mass = manipulator.map_or(f64::INFINITY, |m| m.reflected_mass(meeting.point, meeting.normal));
            let speed = (motion.transform(meeting.point) - meeting.point).dot(meeting.normal) / dt;
            let Meeting { point, normal, .. } = *meeting;
            let Spring { stiffness, gap, damping } = Spring::at(meeting.gap, meeting.room).against(mass, dt);
            Obstacle { point, normal, gap, stiffness, damping, speed, force: 0.0 }
        };
        let mut obstacles: Vec<Obstacle> = found.iter().map(obstacle).collect();
        let Wrench { force, torque } = given[k];
        let load = Wrench { force, torque: torque - tip.translation.cross(force) };
        arms[k].step(load, &mut obstacles, dt)?;
        let mut sum = force;
        for ((meeting, other), obstacle) in found.iter().zip(&obstacles) {
            let force = obstacle.force * meeting.normal;
            sum += force;
            arms[k].state.pressed.add(meeting, obstacle.force);
            if let Some(j) = other {
                given[*j] += Wrench { force: -force, torque: meeting.point.cross(-force) };
            }
        }
        arms[k].state.solid.add(sum);
        Ok(())
    }
}

/// Speed with which arm `k` comes nearer to what it may meet, arm `other` or the solid world (m/s).
fn closing_speed(arms: &[ArmUnit], k: usize, meeting: &Meeting, other: Option<usize>) -> f64 {
    let velocity = |j: usize| {
        let manipulator = arms[j].drive.manipulator();
        manipulator.map_or(DVec3::ZERO, |m| m.measured_cv().at(m.measured_cp().translation, meeting.point))
    };
    (other.map_or(DVec3::ZERO, velocity) - velocity(k)).dot(meeting.normal)
}
