//! The strain of the tissue at an arm's instrument, as the force guard sees it.

use super::overstretch;
use super::strain::Strain;
use crate::World;
use crate::cell::arm::ArmUnit;

/// Stretch of an edge and share of its rest volume of an element at which the force guard stops an
/// arm. Warnings come later.
const MAX_STRETCH: f64 = 4.0;
const MIN_VOLUME: f64 = 0.03;

/// Elements below this share of their rest volume count as those at it: an element of a lattice's
/// mesh may be flat or inside out, and a load must stay finite.
const LEAST_VOLUME: f64 = 1e-3;

/// Tissue with an element below this share of its rest volume is squeezed between the instrument
/// and something hard, which then is nearer than ...
const SQUEEZED: f64 = 0.4;

/// ... that share of the thickness of an organ (m).
const THICKNESS: f64 = 0.01;

/// The strain of the tissue at one arm's instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::cell) struct TissueAtArm {
    /// Length of the most stretched edge over that at rest.
    stretch: f64,
    /// Smallest volume of an element over that at rest.
    volume: f64,
    /// Whether the jaws hold it. Then they crush it, not the arm's motion.
    held: bool,
}

impl Default for TissueAtArm {
    fn default() -> Self {
        Self { stretch: 1.0, volume: 1.0, held: false }
    }
}

impl TissueAtArm {
    /// That of `arm`, with the strains of all organs of `world`.
    pub fn of(world: &World, arm: &ArmUnit, strains: &[Strain]) -> Self {
        let mut worst = Self { held: arm.state.held.is_some(), ..Self::default() };
        for (organ, strain) in strains.iter().enumerate() {
            if overstretch::is_at(world, arm, strain.at, organ) {
                worst.stretch = worst.stretch.max(strain.stretch);
            }
            if overstretch::is_at(world, arm, strain.crushed_at, organ) {
                worst.volume = worst.volume.min(strain.volume);
            }
        }
        worst
    }

    /// The share of its limit that it has. Squared, because arms come near the limits fast.
    pub fn share(&self) -> f64 {
        let crushed = if self.held { 0.0 } else { MIN_VOLUME / self.volume.max(LEAST_VOLUME) };
        (self.stretch / MAX_STRETCH).max(crushed).powi(2)
    }

    /// Whether it exceeds a limit within `frames` frames: if its strain continues to change as
    /// since `last`, a frame ago, or if the instrument continues to press on it by `way` (m) a
    /// frame.
    pub fn will_exceed(&self, last: &Self, way: f64, frames: f64) -> bool {
        self.stretch + frames * (self.stretch - last.stretch) > MAX_STRETCH
            || self.volume + frames * (self.volume - last.volume) < MIN_VOLUME
            || !self.held && self.volume < SQUEEZED && frames * way > THICKNESS * (self.volume - MIN_VOLUME)
    }

    /// Its numbers.
    pub fn numbers(&self) -> [f64; 3] {
        let Self { stretch, volume, held } = *self;
        [stretch, volume, f64::from(u8::from(held))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_that_is_flat_or_inside_out_has_a_finite_share() {
        for volume in [1e-2, 1e-6, 0.0, -0.5] {
            let share = TissueAtArm { volume, ..TissueAtArm::default() }.share();
            assert!(share > 1.0 && share < 1e4, "{volume}: {share}");
        }
    }
}
