//! A new start for an existing manipulator: the reset of an episode, without building models again.

use super::control::Memory;
use super::controlled_arm::{Manipulator, ManipulatorState, START_SEARCHES};
use super::reference::Reference;
use crate::chain::{ArmState, InverseOptions};
use crate::instrument::Coordinates;
use crate::port::RimState;
use crate::{Error, Result};
use glam::DVec3;

impl Manipulator {
    /// Puts the arm at rest at `start`, as [`Manipulator::new`] does. The controller's joint
    /// inertias stay those of the first start, so that states of all starts continue bit for bit in
    /// identical manipulators.
    ///
    /// # Errors
    /// A start outside the limits or out of reach. The state is then unchanged.
    pub fn restart(&mut self, start: &Coordinates) -> Result<()> {
        let start = Coordinates::from_action(start.to_action())?;
        let (kept, excess) = self.limits.clamp(&start);
        if let Some((name, by)) = excess.binding().next() {
            return Err(Error::invalid("start", format!("its {name} is outside the limits by {by:.4} (SI units)")));
        }
        let target = self.port.flange(&self.instrument, &kept);
        let options = InverseOptions { restarts: START_SEARCHES, tolerance: [1e-9, 1e-9], ..InverseOptions::default() };
        let found = self.arm.inverse(&target, &self.arm.home(), &options)?;
        if !found.reached {
            let off = 1e3 * found.translation.length();
            let reason = format!("the flange of arm '{}' would be {off:.1} mm from its pose", self.arm.name());
            return Err(Error::invalid("start", reason));
        }
        let dynamics = self.believed.dynamics(&found.q, &self.arm.zeros());
        self.state = ManipulatorState {
            arm: ArmState::at_rest(found.q),
            reference: Reference::at_rest(found.q, &kept, self.period()),
            memory: Memory::at_rest(dynamics.bias),
            rim: RimState::default(),
            jaw: [kept.jaw, 0.0, kept.jaw],
            mount: [DVec3::ZERO; 2],
        };
        let at = self.state.arm;
        self.state.mount = self.mount_reading(&at, &at, &self.arm.frames(&at.q), [DVec3::ZERO; 2], 1.0);
        Ok(())
    }
}
