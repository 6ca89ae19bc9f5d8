//! Random numbers by key instead of by sequence, so that they do not depend on threads, and smooth
//! noise.

use glam::DVec3;
pub(crate) use trocar_core::unit;
use trocar_core::{Random, mix};

/// Hash of a list of keys.
pub(crate) fn key(parts: &[u64]) -> u64 {
    Random::from_keys(parts).key()
}

/// An approximately standard normal number: the sum of four uniform numbers, at most 3.5 in
/// magnitude.
#[inline]
pub(crate) fn normal(h: u64) -> f32 {
    const PER_SIGMA: f32 = 1.732_050_8 / 65536.0;
    const EVERY_OTHER: u64 = 0x0000_ffff_0000_ffff;
    let pairs = (h & EVERY_OTHER) + (h >> 16 & EVERY_OTHER);
    let sum = pairs as u32 + (pairs >> 32) as u32;
    (sum as f32 - 131_070.0) * PER_SIGMA
}

/// Smooth noise in [-1, 1] with features about one unit wide.
pub(crate) fn smooth(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let [x, y, z] = [cell.x as i64, cell.y as i64, cell.z as i64];
    between(p - cell, |dx, dy, dz| corner(seed, [x + dx, y + dy, z + dz]))
}

/// The value of [`smooth`] at the corner of a cell.
fn corner(seed: u64, [x, y, z]: [i64; 3]) -> f64 {
    // 21 bits per axis exceed the number of cells.
    let packed = (x as u64 & 0x1f_ffff) | (y as u64 & 0x1f_ffff) << 21 | (z as u64 & 0x1f_ffff) << 42;
    Random::new(seed).symmetric(mix(packed))
}

/// The value between the corners of a cell, at `f` in [0, 1] along each axis.
#[inline]
fn between(f: DVec3, corner: impl Fn(i64, i64, i64) -> f64) -> f64 {
    let w = f * f * (3.0 - 2.0 * f);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let edge = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), w.x);
    let face = |dz| mix(edge(0, dz), edge(1, dz), w.y);
    mix(face(0), face(1), w.z)
}

/// [`smooth`] on the line y = z = 1/2, with the corners known ahead.
#[derive(Clone, Debug)]
pub(crate) struct SmoothLine {
    seed: u64,
    first: i64,
    /// From `first` on: the four corners at x, of which z varies fastest.
    corners: Vec<[f64; 4]>,
}

impl SmoothLine {
    /// Knows the corners between `from` and `to`.
    pub fn new(seed: u64, from: f64, to: f64) -> Self {
        let first = from.floor() as i64;
        let at = |x: i64| [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[y, z]| corner(seed, [x, y, z]));
        Self { seed, first, corners: (first..=to.floor() as i64 + 1).map(at).collect() }
    }

    pub fn at(&self, x: f64) -> f64 {
        let cell = x.floor();
        let known = usize::try_from(cell as i64 - self.first).ok().and_then(|i| self.corners.get(i..i + 2));
        let Some(known) = known else { return smooth(self.seed, DVec3::new(x, 0.5, 0.5)) };
        between(DVec3::new(x - cell, 0.5, 0.5), |dx, dy, dz| known[dx as usize][(2 * dy + dz) as usize])
    }
}

/// Fractal noise: `octaves` layers, each with half the width and half the strength of the previous
/// one.
pub(crate) fn fractal(seed: u64, p: DVec3, octaves: u32) -> f64 {
    let layer = |k: u32| {
        let scale = f64::from(1 << k);
        smooth(seed.wrapping_add(u64::from(k)), p * scale + DVec3::splat(0.37 * f64::from(k))) / scale
    };
    (0..octaves).map(layer).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let n = 100_000;
        let values: Vec<f64> = (0..n).map(|i| f64::from(normal(mix(i)))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02, "mean {mean}, variance {variance}");
    }

    #[test]
    fn noise_on_a_line_has_the_same_bits() {
        let line = SmoothLine::new(5, -0.3, 7.2);
        for i in -200..1000 {
            let x = 0.0101 * f64::from(i);
            assert_eq!(line.at(x), smooth(5, DVec3::new(x, 0.5, 0.5)), "{x}");
        }
    }

    #[test]
    fn smooth_noise_is_continuous_and_bounded() {
        let mut last = smooth(7, DVec3::ZERO);
        for i in 1..2000 {
            let value = smooth(7, DVec3::new(0.005 * f64::from(i), -0.003 * f64::from(i), 0.2));
            assert!(value.abs() <= 1.0 && (value - last).abs() < 0.05);
            last = value;
        }
    }
}
