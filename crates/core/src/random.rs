//! Counter-based random numbers: each number depends only on a key and an index, never on what was
//! drawn before. The same key gives the same number on any thread, in any order.
//!
//! The bits come from SplitMix64's finaliser (G. L. Steele, D. Lea, C. H. Flood, "Fast Splittable
//! Pseudorandom Number Generators", OOPSLA 2014).

use std::f64::consts::TAU;

/// Mixes 64 bits: SplitMix64's increment and finaliser.
pub const fn mix(x: u64) -> u64 {
    let z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A number in [0, 1) from the upper 53 of 64 random bits.
pub fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// A number of the standard normal distribution from two independent uniform numbers in [0, 1)
/// (G. E. P. Box, M. E. Muller, 1958).
pub fn standard_normal(a: f64, b: f64) -> f64 {
    (-2.0 * libm::log(1.0 - a)).sqrt() * libm::cos(TAU * b)
}

/// A counter-based generator: a key, whose numbers are addressed by index.
///
/// ```
/// use trocar_core::Random;
///
/// let noise = Random::from_keys(&[7, 3]); // seed 7, frame 3
/// assert_eq!(noise.uniform(12), noise.uniform(12));
/// assert!((0.0..1.0).contains(&noise.uniform(12)));
/// let pixel = noise.stream(12); // a generator of its own
/// assert_ne!(pixel.normal(0), pixel.normal(1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random {
    key: u64,
}

impl Random {
    /// The generator whose key is `key` itself.
    pub const fn new(key: u64) -> Self {
        Self { key }
    }

    /// The generator of a list of keys, such as a seed and a frame. The order matters.
    pub fn from_keys(keys: &[u64]) -> Self {
        keys.iter().fold(Self::new(0), |random, key| random.stream(*key))
    }

    /// The key.
    pub const fn key(self) -> u64 {
        self.key
    }

    /// 64 random bits at `index`.
    pub const fn bits(self, index: u64) -> u64 {
        mix(self.key ^ index)
    }

    /// An independent generator at `index`. Its key is [`Self::bits`].
    pub const fn stream(self, index: u64) -> Self {
        Self::new(self.bits(index))
    }

    /// A uniform number in [0, 1) at `index`.
    pub fn uniform(self, index: u64) -> f64 {
        unit(self.bits(index))
    }

    /// A uniform number in [-1, 1) at `index`.
    pub fn symmetric(self, index: u64) -> f64 {
        2.0 * self.uniform(index) - 1.0
    }

    /// A number of the standard normal distribution at `index`. It uses the uniform numbers at
    /// 2 `index` and 2 `index` + 1.
    pub fn normal(self, index: u64) -> f64 {
        standard_normal(self.uniform(2 * index), self.uniform(2 * index + 1))
    }

    /// Numbers in order, for loops that draw an unknown count of them.
    pub const fn sequence(self) -> RandomSequence {
        RandomSequence { state: self.key }
    }
}

/// Random numbers in order, from [`Random::sequence`]: every state is [`mix`] of the one before.
#[derive(Clone, Debug)]
pub struct RandomSequence {
    state: u64,
}

impl RandomSequence {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.state = mix(self.state);
        self.state
    }

    /// The next uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        unit(self.bits())
    }

    /// The next number of the standard normal distribution; takes two uniform numbers.
    pub fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(), self.uniform());
        standard_normal(a, b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean, mean square and mean fourth power.
    fn moments(values: impl Iterator<Item = f64>) -> [f64; 3] {
        let (mut sums, mut count) = ([0.0; 3], 0.0);
        for v in values {
            [v, v.powi(2), v.powi(4)].iter().zip(&mut sums).for_each(|(v, sum)| *sum += v);
            count += 1.0;
        }
        sums.map(|s| s / count)
    }

    #[test]
    fn bits_are_those_of_the_published_generator() {
        // The first two outputs of SplitMix64 with seed 1234567.
        let gamma = 0x9e37_79b9_7f4a_7c15_u64;
        let outputs = [0, 1].map(|k: u64| mix(1_234_567_u64.wrapping_add(k.wrapping_mul(gamma))));
        assert_eq!(outputs, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    /// Recorded phantoms depend on these bits.
    #[test]
    fn keys_and_sequences_keep_their_bits() {
        let random = Random::from_keys(&[1, 2, 3]);
        assert_eq!((random.key(), random.bits(4)), (0xd073_4750_fde3_62b3, 0xd55c_cd4a_eb3c_cafb));
        let mut sequence = random.sequence();
        assert_eq!(sequence.uniform(), 0.071_663_707_638_260_13);
        assert!((sequence.normal() - 0.729_763_283_218_560_4).abs() < 1e-14);
    }

    #[test]
    fn uniform_and_normal_numbers_have_their_moments() {
        const COUNT: u64 = 40_000;
        for random in [Random::new(0), Random::new(7), Random::from_keys(&[1, 2])] {
            let mut sequence = random.sequence();
            let [mean, square, fourth] = moments((0..COUNT).map(|k| random.symmetric(k)));
            // Five standard deviations of each mean.
            assert!(mean.abs() < 0.015 && (square - 1.0 / 3.0).abs() < 0.008 && (fourth - 0.2).abs() < 0.007);
            for [mean, square, fourth] in
                [moments((0..COUNT).map(|k| random.normal(k))), moments((0..COUNT).map(|_| sequence.normal()))]
            {
                assert!(mean.abs() < 0.025 && (square - 1.0).abs() < 0.036 && (fourth - 3.0).abs() < 0.25);
            }
        }
    }

    #[test]
    fn keys_give_unrelated_numbers() {
        const COUNT: u64 = 40_000;
        let correlation =
            |a: Random, b: Random| (0..COUNT).map(|k| a.symmetric(k) * b.symmetric(k)).sum::<f64>() / COUNT as f64;
        let base = Random::from_keys(&[1, 2]);
        for other in [Random::from_keys(&[2, 1]), Random::from_keys(&[1, 3]), base.stream(0), base.stream(1)] {
            assert!(correlation(base, other).abs() < 5.0 / 3.0 / (COUNT as f64).sqrt());
        }
    }
}
