//! Normal numbers that depend on a key, not on their order: the same for any number of threads.

use glam::DVec3;
use std::f64::consts::TAU;
use trocar_core::{Random, mix};

/// Three independent numbers of the standard normal distribution for a list of keys.
///
/// The bits differ from those of [`Random::normal`]; published figures depend on them.
pub(super) fn normals(keys: &[u64]) -> DVec3 {
    let random = Random::from_keys(keys);
    let uniform = |k: u64| ((random.bits(mix(k)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let one = |k: u64| (-2.0 * uniform(2 * k).ln()).sqrt() * (TAU * uniform(2 * k + 1)).cos();
    DVec3::new(one(0), one(1), one(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_normal_and_independent() {
        const COUNT: u64 = 20_000;
        let all: Vec<DVec3> = (0..COUNT).map(|k| normals(&[7, k])).collect();
        let mean = |f: &dyn Fn(&DVec3) -> f64| all.iter().map(f).sum::<f64>() / COUNT as f64;
        // Four standard deviations of each mean.
        assert!(mean(&|v| v.x).abs() < 0.03 && mean(&|v| v.z).abs() < 0.03);
        assert!((mean(&|v| v.y * v.y) - 1.0).abs() < 0.04 && (mean(&|v| v.x.powi(4)) - 3.0).abs() < 0.3);
        assert!(mean(&|v| v.x * v.y).abs() < 0.03 && mean(&|v| v.y * v.z).abs() < 0.03);
        assert_eq!(normals(&[1, 2]), normals(&[1, 2]));
    }
}
