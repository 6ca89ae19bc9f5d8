//! Random motion: the baseline that every policy should exceed.

use super::aim::eased;
use super::{CHUNK, Policy};
use crate::{Episode, Result};
use trocar_cell::{Action, Setpoint, Workspace};
use trocar_robot::instrument::Coordinates;
use trocar_scene::EpisodeRandom;

/// Time from one random place to the next (s).
const HOP_S: f64 = 2.0;

/// Goes from one random place within the arms' limits to the next, jaws included; half of the time
/// deep, where the tissue is.
#[derive(Clone, Debug)]
pub struct RandomWalk {
    random: EpisodeRandom,
    count: u64,
    hop: u64,
    from: Vec<Setpoint>,
    to: Vec<Setpoint>,
}

impl Default for RandomWalk {
    fn default() -> Self {
        Self { random: EpisodeRandom::new(0, "random"), count: 0, hop: 0, from: Vec::new(), to: Vec::new() }
    }
}

impl RandomWalk {
    fn place(&self, episode: &Episode, k: usize) -> Result<Setpoint> {
        let workspace = episode.cell().workspace(episode.cell().arms()[k].0.name())?;
        let first = 32 * self.hop + 8 * k as u64;
        let unit = |n: u64| self.random.unit(first + n);
        let Workspace::Port(space) = workspace else {
            let bounds = workspace.bounds();
            return Ok(Setpoint(std::array::from_fn(|n| {
                let [low, high] = bounds[n];
                low + (high - low) * unit(n as u64)
            })));
        };
        let limits = &space.limits;
        let lean = 0.8 * limits.tilt * unit(0).sqrt();
        let azimuth = std::f64::consts::TAU * unit(1);
        let [low, high] = limits.insertion;
        let low = if unit(2) < 0.5 { 0.5 * (low + high) } else { low };
        let c = Coordinates {
            pivots: [lean * libm::cos(azimuth), lean * libm::sin(azimuth)],
            insertion: low + (high - low) * unit(3),
            roll: limits.roll[0] + (limits.roll[1] - limits.roll[0]) * unit(4),
            jaw: unit(5),
        };
        Ok(limits.clamp(&c).0.into())
    }
}

impl Policy for RandomWalk {
    fn name(&self) -> &str {
        "random"
    }

    fn begin(&mut self, episode: &Episode, seed: u64) -> Result<()> {
        *self = Self { random: EpisodeRandom::new(seed, "random"), ..Self::default() };
        self.to = episode.cell().observe().iter().map(|arm| arm.commanded).collect();
        Ok(())
    }

    fn act(&mut self, episode: &Episode) -> Result<Vec<Action>> {
        let hop = ((HOP_S / episode.cell().period()).round() as u64).max(1);
        let mut chunk = Vec::with_capacity(CHUNK);
        for _ in 0..CHUNK {
            if self.count.is_multiple_of(hop) {
                self.from = std::mem::take(&mut self.to);
                self.to = (0..self.from.len()).map(|k| self.place(episode, k)).collect::<Result<_>>()?;
                self.hop += 1;
            }
            self.count += 1;
            let share = eased(((self.count - 1) % hop + 1) as f64 / hop as f64);
            let all: Vec<Setpoint> = self.from.iter().zip(&self.to).map(|(a, b)| a.towards(b, share)).collect();
            chunk.push(Action::targets(&all));
        }
        Ok(chunk)
    }
}
