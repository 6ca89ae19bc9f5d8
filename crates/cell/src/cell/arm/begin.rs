//! Where an arm begins: at rest in its start pose, out of the organs.

use super::{ArmState, ArmUnit};
use crate::cell::setpoint::Setpoint;
use crate::cell::solid::Solids;
use crate::{Result, World};
use trocar_core::Pose;

/// A start in an organ is drawn back by this step (m) ...
const STEP: f64 = 1e-3;

/// ... until the instrument has been out of organs for so many steps. Tissue that moves presses on
/// an instrument whose axis has just come out.
const CLEAR_STEPS: usize = 5;

impl ArmUnit {
    /// Puts the arm at rest at `start`. A start in an organ of `world` is drawn back along the
    /// shaft until the instrument is out, as far as the workspace allows. What varies from episode
    /// to episode, organs as well as starts, may put an instrument there.
    ///
    /// # Errors
    /// A start out of the arm's reach.
    pub fn begin(&mut self, start: &Setpoint, world: &World, solids: &Solids) -> Result<()> {
        let space = self.model.workspace.clone();
        let (mut start, mut at) = (*start, space.tip(start));
        self.rest_at(start, at);
        if !self.is_out(world, solids) {
            let mut clear = 0;
            while clear < CLEAR_STEPS {
                let back = space.behind(&start, STEP);
                let moved = space.tip(&back).translation.distance(at.translation);
                (start, at) = (back, space.tip(&back));
                self.rest_at(start, at);
                clear = if self.is_out(world, solids) { clear + 1 } else { 0 };
                // At the end of the workspace.
                if moved < 0.5 * STEP {
                    break;
                }
            }
        }
        self.drive.restart(&start)?;
        self.rest_at(start, self.drive.tip());
        Ok(())
    }

    /// Whether no axis of the instrument's parts is inside an organ, and no tissue that cannot move
    /// presses on them.
    pub fn is_out(&self, world: &World, solids: &Solids) -> bool {
        let presses = || solids.still(self, &self.rods()).iter().any(|m| m.organ.is_some() && m.gap < 0.0);
        self.pierces(world).is_empty() && !presses()
    }

    /// Sets the state to rest at `start` with the tip frame at `pose`. Nothing is held.
    fn rest_at(&mut self, start: Setpoint, pose: Pose) {
        let (mut jaw, mut scissors) = (self.state.jaw, self.state.scissors);
        jaw.rest();
        scissors.rest();
        self.state = ArmState::new(pose, &self.model, start, self.state.design, jaw, scissors);
    }
}
