//! Takes the swing out of organs that still move when the settling phase is over: a large soft
//! organ swings for many seconds.
//!
//! Kinetic damping (Cundall 1976): everything is stopped whenever the kinetic energy has passed a
//! peak, until nothing moves fast for a while by itself.

use crate::World;
use crate::measure::SETTLED_SPEED;

/// Organs that have not come to rest after the settling phase are calmed for at most this many
/// frames ...
const CALM_FRAMES: usize = 300;
/// ... until they have been slow, undisturbed, for this many.
const CALM_FOR: usize = 12;

/// Kinetic damping in progress.
pub(crate) struct Calm {
    energy: f64,
    /// Frames in a row that were slow without having been stopped.
    slow_for: usize,
    frames: usize,
}

impl Calm {
    /// Begins; organs that have settled need none.
    pub fn new(world: &World, settled: bool) -> Self {
        let energy = world.state.kinetic_energy(&world.model);
        Self { energy, slow_for: if settled { CALM_FOR } else { 0 }, frames: 0 }
    }

    /// Whether all is calm, or is not going to be.
    pub fn done(&self) -> bool {
        self.slow_for >= CALM_FOR || self.frames >= CALM_FRAMES
    }

    /// Sees to a frame that has been stepped and whose greatest node speed was `speed` [m/s].
    pub fn after_frame(&mut self, world: &mut World, speed: f64) {
        self.frames += 1;
        let now = world.state.kinetic_energy(&world.model);
        (self.slow_for, self.energy) = if speed < SETTLED_SPEED {
            // Slow: left alone, to show that it stays so.
            (self.slow_for + 1, now)
        } else if now < self.energy {
            world.state.stop();
            (0, 0.0)
        } else {
            (0, now)
        };
    }
}
