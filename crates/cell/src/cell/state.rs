//! Saving, restoring and hashing a cell.

#[cfg(test)]
mod tests;

use super::arm::ArmState;
use super::delay::Waiting;
use super::drive::DriveState;
use super::rules::{Edges, OrganWatch};
use super::solid::PinnedSurface;
use super::{Cell, Timing};
use crate::Result;
use crate::world::WorldState;
use xxhash_rust::xxh3::Xxh3;

/// Everything of a [`Cell`] that changes: tissue with its cuts and grasps, arms, controllers, jaws,
/// loads, time. Plain data.
#[derive(Clone, Debug)]
pub struct CellState {
    world: WorldState,
    arms: Vec<(ArmState, DriveState)>,
    watches: Vec<OrganWatch>,
    touch: bool,
    waiting: Waiting,
    periods: u64,
}

impl CellState {
    /// Hash over every bit on which later steps depend.
    pub fn hash(&self) -> u64 {
        let Self { world, arms, watches, touch, waiting, periods } = self;
        let mut hash = Xxh3::new();
        hash.update(&periods.to_le_bytes());
        hash.update(&world.hash().to_le_bytes());
        watches.iter().for_each(|watch| hash.update(&watch.bytes()));
        hash.update(&[u8::from(*touch)]);
        for (arm, drive) in arms {
            for number in drive.numbers().into_iter().chain(arm.numbers()) {
                hash.update(&number.to_bits().to_le_bytes());
            }
        }
        // No numbers if nothing waits: hashes of cells without a delay equal those of earlier
        // versions.
        waiting.numbers().for_each(|number| hash.update(&number.to_bits().to_le_bytes()));
        hash.digest()
    }
}

impl Cell {
    /// A cell of its own in the same state. Bodies are shared, so that it costs little beside
    /// building and settling another. Forces and events of the last frame are not copied.
    ///
    /// # Errors
    /// Threads that the system refuses.
    pub fn try_clone(&self) -> Result<Self> {
        Ok(Self {
            world: self.world.try_clone()?,
            arms: self.arms.clone(),
            periods: self.periods,
            control_hz: self.control_hz,
            frames: self.frames,
            physics_steps: self.physics_steps,
            delay: self.delay,
            waiting: self.waiting.clone(),
            sever: self.sever,
            strain_guard: self.strain_guard,
            motions: self.motions.clone(),
            edges: self.edges.clone(),
            solids: self.solids.clone(),
            contact: self.contact,
            watches: self.watches.clone(),
            touch: self.touch,
            timing: Timing::default(),
        })
    }

    /// The present state.
    pub fn save(&self) -> CellState {
        // Each field is named, because a new field must be kept or left out on purpose.
        let Self {
            world,
            arms,
            periods,
            watches,
            touch,
            waiting,
            control_hz: _,
            frames: _,
            physics_steps: _,
            delay: _,
            sever: _,
            motions: _,
            edges: _,
            solids: _,
            contact: _,
            strain_guard: _,
            timing: _,
        } = self;
        CellState {
            world: world.save(),
            arms: arms.iter().map(|arm| (arm.state.clone(), arm.drive.state())).collect(),
            watches: watches.clone(),
            touch: *touch,
            waiting: waiting.clone(),
            periods: *periods,
        }
    }

    /// Restores a state of this cell, or of another with the same scene and specimen. The steps
    /// after it are the same to the bit.
    ///
    /// # Errors
    /// A state of a cell with other arms or organs.
    pub fn restore(&mut self, state: &CellState) -> Result<()> {
        let CellState { world, arms, watches, touch, waiting, periods } = state;
        if arms.len() != self.arms.len() {
            let (given, here) = (arms.len(), self.arms.len());
            return Err(crate::Error::Option(format!("the state has {given} arms, the cell {here}")));
        }
        let cut = self.world.cuts > 0 || world.is_cut();
        self.world.restore(world)?;
        if cut {
            // The same number of cuts may be other cuts.
            self.edges = Edges::of(&self.world);
            self.solids.pinned = PinnedSurface::felt(&self.world, self.contact);
        }
        for (arm, (state, drive)) in self.arms.iter_mut().zip(arms) {
            arm.drive.restore(drive)?;
            arm.state.clone_from(state);
        }
        self.watches.clone_from(watches);
        self.touch = *touch;
        self.waiting.clone_from(waiting);
        self.periods = *periods;
        Ok(())
    }

    /// Hash over every bit on which later steps depend.
    pub fn hash(&self) -> u64 {
        self.save().hash()
    }
}
