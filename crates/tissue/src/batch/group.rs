//! Sixteen instances: one unit of work.

use super::grasps::Grasps;
use crate::registers::{BLOCK, Block};

/// The state of sixteen instances, one in each lane. Lanes without an instance are at rest.
pub(super) struct Group {
    /// The factor that serves all of them.
    pub factor: usize,
    /// Number of its instances: those of the first lanes.
    pub members: usize,
    /// Displacements of the nodes (cells), and velocities (cells/s).
    pub u: Vec<[Block<f32>; 3]>,
    pub v: Vec<[Block<f32>; 3]>,
    /// One over the square of the substep, Young's modulus and the edge of a cell (1/kg).
    pub inertia: Block<f32>,
    /// Gravity (cells/s2).
    pub gravity: [Block<f32>; 3],
    pub grasps: Grasps,
}

impl Group {
    /// At rest, without instances.
    pub fn new(factor: usize, count: usize) -> Self {
        let zero = [Block([0.0; BLOCK]); 3];
        Self {
            factor,
            members: 0,
            u: vec![zero; count],
            v: vec![zero; count],
            inertia: Block([1.0; BLOCK]),
            gravity: zero,
            grasps: Grasps::new(),
        }
    }

    /// Bits of the lanes that stay as they are.
    pub fn idle(&self) -> u16 {
        let stays = |lane: usize| lane >= self.members || !self.grasps.is_sound(lane);
        (0..BLOCK).filter(|lane| stays(*lane)).fold(0, |bits, lane| bits | 1 << lane)
    }
}
