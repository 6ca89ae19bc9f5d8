//! Jaws that turn until the bed or pinned tissue pushes their blades back: with their opening
//! force, or, when they close, with the scene's force limit, as ideal arms move. Another instrument
//! yields instead: it is pushed away.
//!
//! Blades turn once a tissue frame, by up to 1.4 mm at their tips, which is nearly their radius.
//! Springs in the arms' steps would act too late.

use super::Solids;
use super::meeting::Meeting;
use super::rod::Rod;
use super::spring::Spring;
use crate::Gripper;
use crate::cell::arm::ArmUnit;
use glam::DVec3;

/// Bisections of the turn of jaws that solids stop.
const BISECTIONS: usize = 8;

/// A turn is checked in steps of at most this angle (rad), which is 0.7 mm at a blade's tip. So no
/// blade jumps over a solid.
const MAX_TURN: f64 = 0.035;

impl Solids {
    /// The angle to which the jaws of `arm` turn in this frame towards `wanted` (rad). They stop
    /// where solids would push back with more than the jaws' force and with more than at the
    /// present angle.
    pub fn turn_jaws(&self, arm: &ArmUnit, wanted: f64) -> f64 {
        let angle = arm.state.gripper.jaw_angle;
        if wanted == angle {
            return wanted;
        }
        let direction = (wanted - angle).signum();
        let crossed = self.blades_cross(arm, angle);
        let against = |at: f64| match !crossed && self.blades_cross(arm, at) {
            true => f64::INFINITY,
            false => -direction * self.opening_force(arm, at),
        };
        let most = if direction > 0.0 { arm.state.jaw.opening_force() } else { arm.model.stop_force };
        let allowed = most.max(against(angle));
        let steps = ((wanted - angle).abs() / MAX_TURN).ceil();
        let mut reached = angle;
        for step in 1..=steps as usize {
            let next = angle + (wanted - angle) * step as f64 / steps;
            if against(next) <= allowed {
                reached = next;
                continue;
            }
            let mut stopped = next;
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (reached + stopped);
                if against(middle) <= allowed { reached = middle } else { stopped = middle }
            }
            break;
        }
        reached
    }

    /// Whether the axis of a blade of `arm` goes through pinned tissue with the jaws at `angle`
    /// (rad). A surface does not push back an axis that has crossed it. Blades that shear go
    /// through tissue.
    fn blades_cross(&self, arm: &ArmUnit, angle: f64) -> bool {
        if arm.state.shears.is_some() {
            return false;
        }
        let gripper = Gripper { pose: arm.drive.tip(), jaw_angle: angle };
        let blades: Vec<Rod> = arm.rods_of(&gripper).into_iter().filter(|rod| rod.part != 0).collect();
        self.pinned.is_crossed(&blades, &self.holes, arm.model.tools.gripper)
    }

    /// Force with which solids push the blades of `arm` apart with the jaws at `angle` (N): the
    /// mean over both blades of the outward force, as that of tissue.
    fn opening_force(&self, arm: &ArmUnit, angle: f64) -> f64 {
        let gripper = Gripper { pose: arm.drive.tip(), jaw_angle: angle };
        let rods = arm.rods_of(&gripper);
        let mut sum = 0.0;
        for (part, side) in [(1, 1.0), (2, -1.0)] {
            let outwards = gripper.blade(side).rotation * (side * DVec3::Y);
            let blade: Vec<Rod> = rods.iter().filter(|rod| rod.part == part).copied().collect();
            let push = |m: Meeting| Spring::at(m.gap, m.room).force() * m.normal.dot(outwards);
            sum += self.still(arm, &blade).into_iter().map(push).sum::<f64>();
        }
        0.5 * sum
    }
}
