//! Saving, restoring and hashing a cell.

use super::Cell;
use super::overstretch::Edges;
use super::station::Moving;
use crate::Result;
use crate::world::WorldState;
use trocar_robot::manipulator::ManipulatorState;
use xxhash_rust::xxh3::Xxh3;

/// Everything of a [`Cell`] that changes: tissue with its cuts and grasps, arms, controllers, jaws,
/// loads, time. Plain data.
#[derive(Clone, Debug)]
pub struct CellState {
    world: WorldState,
    arms: Vec<(Moving, ManipulatorState)>,
    waits: Vec<u32>,
    touch: bool,
    periods: u64,
}

impl CellState {
    /// Hash over every bit that the future depends on.
    pub fn hash(&self) -> u64 {
        let mut hash = Xxh3::new();
        hash.update(&self.periods.to_le_bytes());
        hash.update(&self.world.hash().to_le_bytes());
        self.waits.iter().for_each(|w| hash.update(&w.to_le_bytes()));
        hash.update(&[u8::from(self.touch)]);
        for (arm, manipulator) in &self.arms {
            // Printed numbers are as exact as their bits: the shortest text that reads back as the
            // same.
            hash.update(format!("{:?}", manipulator).as_bytes());
            for number in arm.numbers() {
                hash.update(&number.to_bits().to_le_bytes());
            }
        }
        hash.digest()
    }
}

impl Cell {
    /// The state as it is now.
    pub fn save(&self) -> CellState {
        let arms = self.stations.iter().map(|s| (s.now.clone(), s.manipulator.state())).collect();
        CellState {
            world: self.world.save(),
            arms,
            waits: self.waits.clone(),
            touch: self.touch,
            periods: self.periods,
        }
    }

    /// Puts back a state that this cell, or another of the same scene and specimen, gave. What
    /// comes after is the same to the bit.
    ///
    /// # Errors
    /// A state of a cell with other arms or organs.
    pub fn restore(&mut self, state: &CellState) -> Result<()> {
        if state.arms.len() != self.stations.len() {
            let (given, here) = (state.arms.len(), self.stations.len());
            return Err(crate::Error::Option(format!("the state has {given} arms, the cell {here}")));
        }
        let cut = self.world.cuts > 0 || state.world.is_cut();
        self.world.restore(&state.world)?;
        if cut {
            // As many cuts are not the same cuts.
            self.edges = Edges::of(&self.world);
        }
        for (station, (now, manipulator)) in self.stations.iter_mut().zip(&state.arms) {
            station.manipulator.restore(manipulator)?;
            station.now.clone_from(now);
        }
        self.waits.clone_from(&state.waits);
        self.touch = state.touch;
        self.periods = state.periods;
        Ok(())
    }

    /// Hash over every bit that the future depends on.
    pub fn hash(&self) -> u64 {
        self.save().hash()
    }
}
