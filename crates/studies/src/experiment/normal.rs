//! Normal numbers by key instead of by order: the same for any number of threads.

use glam::DVec3;
use std::f64::consts::TAU;

/// Three independent normal numbers of standard deviation 1 for a list of keys (SplitMix64's finaliser; Box and Muller).
pub(super) fn normals(keys: &[u64]) -> DVec3 {
    let key = keys.iter().fold(0, |h, k| scramble(h ^ *k));
    let uniform = |k: u64| ((scramble(key ^ scramble(k)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let one = |k: u64| (-2.0 * uniform(2 * k).ln()).sqrt() * (TAU * uniform(2 * k + 1)).cos();
    DVec3::new(one(0), one(1), one(2))
}

fn scramble(x: u64) -> u64 {
    let z = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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
