//! The numbers that paths are made of: an Owen-scrambled Sobol sequence in each pixel (Burley,
//! "Practical Hash-based Owen Scrambling", 2020). The samples of a pixel cover the square of its
//! lens, its lights and its directions more evenly than independent numbers do, so the error falls
//! faster.

use crate::random::numbers;
use sobol_burley::{NUM_DIMENSION_SETS_4D, sample_4d};

/// Samples of one sequence; more samples take a new one.
const LENGTH: u32 = 1 << 16;

/// Lights that have dimensions of their own at each bounce.
const LIGHTS: u32 = 4;

/// What four numbers of a path are for, with the number of the bounce.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Purpose {
    /// The place on the pixel.
    Lens,
    /// The place where light enters tissue.
    Subsurface,
    /// The direction of the next part of the path.
    Direction(u32),
    /// Whether the path ends.
    Roulette(u32),
    /// The place on a light, with the light's number.
    Light(u32, u32),
}

impl Purpose {
    /// The set of four dimensions. The first ones are the most even.
    fn set(self) -> u32 {
        let of = |bounce: u32, k: u32| 2 + bounce * (2 + LIGHTS) + k;
        match self {
            Self::Lens => 0,
            Self::Subsurface => 1,
            Self::Direction(bounce) => of(bounce, 0),
            Self::Roulette(bounce) => of(bounce, 1),
            Self::Light(bounce, light) if light < LIGHTS => of(bounce, 2 + light),
            // Past all sets of bounces: numbers that are independent of theirs.
            Self::Light(bounce, light) => (1 << 16) + (bounce << 8 | light & 0xff),
        }
    }
}

/// The samples of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSamples {
    pixel: u32,
    seed: u32,
}

/// One sample of a pixel: the numbers of a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathSample {
    number: u32,
    scramble: u32,
}

impl PixelSamples {
    /// Of pixel number `pixel` in a picture with this seed.
    pub fn new(pixel: u32, seed: u32) -> Self {
        Self { pixel, seed }
    }

    /// The sample of this number.
    pub fn sample(self, number: u32) -> PathSample {
        let scramble = hash([self.pixel, self.seed, number / LENGTH, 0]);
        PathSample { number: number % LENGTH, scramble }
    }
}

impl PathSample {
    /// Four numbers in [0, 1).
    pub fn draw(self, purpose: Purpose) -> [f32; 4] {
        let set = purpose.set();
        let again = set / NUM_DIMENSION_SETS_4D;
        let scramble = if again == 0 { self.scramble } else { hash([self.scramble, again, 0, 1]) };
        sample_4d(self.number, set % NUM_DIMENSION_SETS_4D, scramble)
    }
}

/// A number for a key.
fn hash(key: [u32; 4]) -> u32 {
    let [a, b, ..] = numbers(key);
    ((a * 65_536.0) as u32) << 16 | (b * 65_536.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of a smooth function of the place on the pixel, over 64 samples: its error is far
    /// below that of independent numbers, and so is that of bounces beyond the sets of dimensions.
    #[test]
    fn samples_are_more_even_than_independent_numbers() {
        for purpose in [Purpose::Lens, Purpose::Direction(3), Purpose::Direction(40), Purpose::Light(2, 9)] {
            let error = |draw: &dyn Fn(u32, u32) -> [f32; 4]| -> f64 {
                let mean = |pixel: u32| -> f64 {
                    let of = |n: u32| {
                        let [a, b, ..] = draw(pixel, n);
                        f64::from(a * b)
                    };
                    (0..64).map(of).sum::<f64>() / 64.0
                };
                ((0..200).map(|pixel| (mean(pixel) - 0.25).powi(2)).sum::<f64>() / 200.0).sqrt()
            };
            let even = error(&|pixel, n| PixelSamples::new(pixel, 7).sample(n).draw(purpose));
            let independent = error(&|pixel, n| numbers([pixel, n, 3, 7]));
            assert!(even < 0.3 * independent, "{purpose:?}: {even} and {independent}");
        }
    }

    #[test]
    fn long_sequences_go_on_with_other_numbers() {
        let pixel = PixelSamples::new(3, 1);
        assert_ne!(pixel.sample(0).draw(Purpose::Lens), pixel.sample(LENGTH).draw(Purpose::Lens));
    }
}
