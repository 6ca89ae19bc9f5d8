//! Random numbers by counting: a number depends on its key alone. So a draw for one purpose never
//! shifts a draw for another.

use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Numbers of one purpose in one episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpisodeRandom {
    key: u64,
}

impl EpisodeRandom {
    /// Those of an episode's `seed` for `purpose`, a name.
    pub fn new(seed: u64, purpose: &str) -> Self {
        Self { key: xxh3_64_with_seed(purpose.as_bytes(), seed) }
    }

    /// 64 bits at `index`.
    pub fn bits(&self, index: u64) -> u64 {
        xxh3_64_with_seed(&index.to_le_bytes(), self.key)
    }

    /// A uniform number in [0, 1) at `index`.
    pub fn unit(&self, index: u64) -> f64 {
        trocar_core::unit(self.bits(index))
    }

    /// A number between `low` and `high` at `index`.
    pub fn within(&self, index: u64, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit(index)
    }

    /// A number to either side of 0 by at most `most`.
    pub fn aside(&self, index: u64, most: f64) -> f64 {
        self.within(index, -most, most)
    }

    /// A number of the standard normal distribution at `index` (Box and Muller 1958).
    pub fn normal(&self, index: u64) -> f64 {
        trocar_core::standard_normal(self.unit(2 * index), self.unit(2 * index + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_decide_and_the_distributions_are_right() {
        let (a, b) = (EpisodeRandom::new(7, "start"), EpisodeRandom::new(7, "noise"));
        assert_eq!(a.bits(3), EpisodeRandom::new(7, "start").bits(3));
        assert_ne!(a.bits(3), b.bits(3));
        assert_ne!(a.bits(3), EpisodeRandom::new(8, "start").bits(3));
        let n = 20_000;
        let mean = (0..n).map(|k| a.unit(k)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        assert!((0..n).all(|k| (0.0..1.0).contains(&a.unit(k))));
        let (sum, square) = (0..n).map(|k| b.normal(k)).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
        assert!((sum / n as f64).abs() < 0.03 && (square / n as f64 - 1.0).abs() < 0.05);
    }
}
