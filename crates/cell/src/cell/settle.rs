//! Organs come to rest before an episode begins.
//!
//! They settle under gravity for a time. A large soft organ swings for many seconds; then kinetic
//! damping (Cundall 1976) stops it: all velocities are set to zero whenever the kinetic energy has
//! passed a peak, until nothing moves fast for a while.

use super::Cell;
use crate::Result;
use serde::{Deserialize, Serialize};

/// Node speed below which tissue is settled (m/s).
const SETTLED_SPEED: f64 = 0.01;

/// Longest kinetic damping (s).
const MAX_DAMPING_S: f64 = 5.0;

/// Damping ends after the organs have been slow for this long without it (s).
const SLOW_S: f64 = 0.2;

/// How the organs came to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settling {
    /// Largest node speed after the settling time, before any damping (m/s).
    pub settled_speed_m_s: f64,
    /// They settled without damping: that speed is below 0.01 m/s.
    pub settled: bool,
    /// How long kinetic damping took (s).
    #[serde(alias = "calmed_s")]
    pub damped_s: f64,
    /// Largest node speed in the end (m/s).
    pub resting_speed_m_s: f64,
}

impl Cell {
    /// Lets the organs settle for `seconds`, then damps the remaining motion.
    ///
    /// # Errors
    /// As [`Cell::step`].
    pub fn settle(&mut self, seconds: f64) -> Result<Settling> {
        let mut speed = 0.0;
        for _ in 0..(seconds / self.period()).round() as usize {
            speed = self.step(None)?.tissue.max_speed;
        }
        let settled = speed < SETTLED_SPEED;
        let mut settling = Settling { settled_speed_m_s: speed, settled, damped_s: 0.0, resting_speed_m_s: speed };
        let (mut slow_s, mut energy) = (0.0, self.world.state.kinetic_energy(&self.world.model));
        while !settled && slow_s < SLOW_S && settling.damped_s < MAX_DAMPING_S {
            settling.resting_speed_m_s = self.step(None)?.tissue.max_speed;
            settling.damped_s += self.period();
            let now = self.world.state.kinetic_energy(&self.world.model);
            (slow_s, energy) = if settling.resting_speed_m_s < SETTLED_SPEED {
                // Slow: not damped any more, to verify that it stays slow.
                (slow_s + self.period(), now)
            } else if now < energy {
                self.world.state.stop();
                (0.0, 0.0)
            } else {
                (0.0, now)
            };
        }
        Ok(settling)
    }
}
