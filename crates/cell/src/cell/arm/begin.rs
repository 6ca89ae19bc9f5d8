//! Where an arm begins: at rest in its start pose, out of the organs.

use super::{ArmState, ArmUnit};
use crate::cell::setpoint::Setpoint;
use crate::{Result, World};
use trocar_core::Pose;

/// A start in an organ is drawn back by this step (m) ...
const STEP: f64 = 1e-3;

/// ... until the instrument's axes have been out of organs for this many steps. An axis that has
/// just come out is less than a radius away, and the organ would push the instrument.
const CLEAR_STEPS: usize = 5;

impl ArmUnit {
    /// Puts the arm at rest at `start`. A start in which the axis of one of the instrument's parts
    /// is inside an organ of `world` is drawn back along the shaft until it is out, as far as the
    /// workspace allows. What varies from episode to episode, organs as well as starts, may put an
    /// instrument there.
    ///
    /// # Errors
    /// A start out of the arm's reach.
    pub fn begin(&mut self, start: &Setpoint, world: &World) -> Result<()> {
        let mut start = *start;
        self.rest_at(start, self.model.workspace.tip(&start));
        if !self.pierces(world).is_empty() {
            let mut clear = 0;
            while clear < CLEAR_STEPS {
                let back = self.model.workspace.behind(&start, STEP);
                if back == start {
                    break;
                }
                start = back;
                self.rest_at(start, self.model.workspace.tip(&start));
                clear = if self.pierces(world).is_empty() { clear + 1 } else { 0 };
            }
        }
        self.drive.restart(&start)?;
        self.rest_at(start, self.drive.tip());
        Ok(())
    }

    /// Sets the state to rest at `start` with the tip frame at `pose`. Nothing is held.
    fn rest_at(&mut self, start: Setpoint, pose: Pose) {
        let (mut jaw, mut scissors) = (self.state.jaw, self.state.scissors);
        jaw.rest();
        scissors.rest();
        self.state = ArmState::new(pose, &self.model, start, self.state.design, jaw, scissors);
    }
}
