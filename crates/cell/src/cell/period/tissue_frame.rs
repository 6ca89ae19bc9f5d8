//! Stage 3: a frame of tissue, in which the tools move to the arms' present places.

use crate::blades::{Tools, opening_force};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;
use crate::{FRAME, GraspDesign, Gripper};
use glam::DVec3;
use std::time::Instant;
use trocar_core::Pose;
use trocar_tissue::{State, StepReport, ToolMotion};

/// Height of instruments without contact (m).
const OUT_OF_CONTACT_HEIGHT: f64 = 100.0;

/// The beginning of a frame of tissue.
pub(super) struct FrameStart {
    /// The tissue's state, if the frame is the first of a grasp.
    state: Option<State>,
    clock: Instant,
}

impl Cell {
    /// Sets the motions of the tools for a frame of tissue.
    pub(super) fn begin_tissue_frame(&mut self) -> FrameStart {
        self.motions.clear();
        for arm in &mut self.arms {
            let wanted = arm.next_angle();
            let angle = self.solids.turn_jaws(arm, wanted);
            self.motions.extend(arm.motions(angle, FRAME));
        }
        let newly_attached = self.arms.iter().any(|arm| arm.is_newly_attached(&self.world));
        FrameStart { state: newly_attached.then(|| self.world.state.clone()), clock: Instant::now() }
    }

    /// Records the frame that began at `start`.
    pub(super) fn end_tissue_frame(&mut self, start: FrameStart, report: &StepReport, log: &mut PeriodLog) {
        self.timing.tissue += start.clock.elapsed();
        self.timing.iterations += report.iterations;
        log.tissue.add(report);
        if let Some(before) = start.state {
            log.activation_step = log.activation_step.max(self.world.largest_motion_since(&before));
        }
    }
}

impl ArmUnit {
    /// The angle of the jaws after the frame, as far as tissue lets them turn (rad).
    fn next_angle(&mut self) -> f64 {
        let (model, state) = (&self.model, &mut self.state);
        let angle = state.gripper.jaw_angle;
        let target = state.wanted.jaw() * model.blades.max_angle;
        // A latched grasp locks the jaws; friction must continue to press.
        if state.held.is_some() && state.design != GraspDesign::Friction {
            return angle;
        }
        let force = opening_force(&state.gripper, Tools::of(0), &state.forces);
        if target < angle {
            // One blade that presses pushes the arm, which has to yield first. Scissors cut
            // instead.
            let blades = state.forces[1].contact.force + state.forces[2].contact.force;
            if state.bite.is_none() && blades.length() > model.force_limit {
                return angle;
            }
            let free = state.jaw.squeeze(angle, force).max(target);
            let most = state.jaw.budget * model.blades.lever();
            return state.bite.as_mut().map_or(free, |bite| bite.close(angle, free, most));
        }
        if let Some(bite) = state.bite.as_mut().filter(|_| target > angle) {
            bite.force = 0.0;
        }
        if model.force_limit.is_finite() && state.guard.sees_strain() {
            return angle;
        }
        state.jaw.open(angle, target, force)
    }

    /// The motions of the instrument's three tools over a tissue frame of `dt` (s) after which the
    /// jaws are at `next_angle` (rad).
    fn motions(&mut self, next_angle: f64, dt: f64) -> [ToolMotion; 3] {
        let (model, state) = (&self.model, &mut self.state);
        let angle = state.gripper.jaw_angle;
        let next = Gripper { pose: self.drive.tip(), jaw_angle: next_angle };
        let mut motions = state.gripper.motions_to(&next);
        state.jaw_rate = (next_angle - angle) / (model.blades.max_angle * dt);
        state.gripper = next;
        // At rest, far from tissue.
        let away = Pose { translation: OUT_OF_CONTACT_HEIGHT * DVec3::Z, ..Pose::IDENTITY };
        let away = ToolMotion { from: away, to: away };
        if state.shears.is_some() {
            motions[1..].fill(away);
        }
        motions
    }
}
