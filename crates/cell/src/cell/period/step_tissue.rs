//! Stage 3: tissue is stepped by a frame, with the tools on their way to where the arms are now.

use crate::blades::{Tools, opening_force};
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::PeriodLog;
use crate::{FRAME, GraspDesign, Gripper};
use glam::DVec3;
use std::time::Instant;
use trocar_core::Pose;
use trocar_tissue::{StepReport, ToolMotion};

/// Height at which tissue feels no instrument (m).
const OUT_OF_CONTACT_HEIGHT: f64 = 100.0;

impl Cell {
    pub(super) fn step_tissue(&mut self, log: &mut PeriodLog) -> StepReport {
        self.motions.clear();
        for arm in &mut self.arms {
            self.motions.extend(arm.motions(FRAME));
        }
        let before = self.arms.iter().any(|arm| arm.is_newly_attached(&self.world)).then(|| self.world.state.clone());
        let clock = Instant::now();
        let report = self.world.step(&self.motions);
        self.timing.tissue += clock.elapsed();
        self.timing.iterations += report.iterations;
        log.tissue.add(&report);
        if let Some(before) = before {
            log.activation_step = log.activation_step.max(self.world.largest_motion_since(&before));
        }
        report
    }
}

impl ArmUnit {
    /// The motions of the instrument's three tools over a tissue frame of `dt` (s).
    fn motions(&mut self, dt: f64) -> [ToolMotion; 3] {
        let (model, state) = (&self.model, &mut self.state);
        let angle = state.gripper.jaw_angle;
        let target = state.wanted.jaw() * model.blades.max_angle;
        // What is latched locks the jaws; friction must go on pressing.
        let locked = state.held.is_some() && state.design != GraspDesign::Friction;
        let next_angle = if locked {
            angle
        } else if target < angle {
            let force = opening_force(&state.gripper, Tools::of(0), &state.forces);
            state.jaw.squeeze(angle, force).max(target)
        } else {
            state.jaw.turn_to(angle, target)
        };
        let next = Gripper { pose: self.drive.tip(), jaw_angle: next_angle };
        let mut motions = state.gripper.motions_to(&next);
        state.jaw_rate = (next_angle - angle) / (model.blades.max_angle * dt);
        state.gripper = next;
        // At rest, far from everything.
        let away = Pose { translation: OUT_OF_CONTACT_HEIGHT * DVec3::Z, ..Pose::IDENTITY };
        let away = ToolMotion { from: away, to: away };
        if state.contact_disabled {
            return [away; 3];
        }
        if state.shears.is_some() || state.blades_disabled {
            motions[1..].fill(away);
        }
        motions
    }
}
