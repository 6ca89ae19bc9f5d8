//! Finds tissue that moves during the window, which a composite of medians blurs.

/// Smallest range of depth that counts as motion (m); the noise of a depth camera at close range
/// stays below it.
const MIN_RANGE_M: f64 = 2e-3;

/// Smallest range of depth that counts as motion, as a share of depth. The noise of a stereo camera
/// grows with depth.
const MIN_RANGE_SHARE: f64 = 0.01;

/// For independent normal noise, the range between the 10th and the 90th percentile (2.563 sigma)
/// over the median difference of consecutive samples (0.6745 sqrt(2) sigma).
const NOISE_RATIO: f64 = 2.563 / 0.953_9;

/// Motion exceeds the range that noise alone explains by this factor.
const MIN_NOISE_FACTOR: f64 = 2.0;

/// Fewest samples of a pixel that are judged.
const MIN_SAMPLES: usize = 8;

/// Share of an organ's pixels that move from which the user is warned.
pub(crate) const WARN_SHARE: f64 = 0.1;

/// Whether a pixel's depth changes by more than the sensor's noise. `depths` are its samples in the
/// order of time and `range` is their 10th to 90th percentile range, both in units of `scale` (m).
///
/// Noise differs from frame to frame, motion over several frames, so the differences of consecutive
/// samples measure the noise. `scratch` is overwritten.
pub(crate) fn moves(depths: &[u16], range: f64, scale: f64, scratch: &mut Vec<u16>) -> bool {
    if depths.len() < MIN_SAMPLES {
        return false;
    }
    let depth = f64::from(depths.iter().copied().max().unwrap_or(0)) * scale;
    if range * scale <= MIN_RANGE_M.max(MIN_RANGE_SHARE * depth) {
        return false;
    }
    scratch.clear();
    scratch.extend(depths.windows(2).map(|pair| pair[0].abs_diff(pair[1])));
    let middle = scratch.len() / 2;
    let (_, median, _) = scratch.select_nth_unstable(middle);
    range > MIN_NOISE_FACTOR * NOISE_RATIO * f64::from(*median)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a pixel moves whose depth (m) in frame `i` is `depth(i)` plus noise of `sigma` (m).
    fn judged(sigma: f64, depth: impl Fn(usize) -> f64) -> bool {
        let scale = 1e-4;
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let samples: Vec<u16> = (0..91)
            .map(|i| {
                let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                ((depth(i) + sigma * normal) / scale).round() as u16
            })
            .collect();
        let mut sorted = samples.clone();
        sorted.sort_unstable();
        let range = f64::from(sorted[81] - sorted[9]);
        moves(&samples, range, scale, &mut Vec::new())
    }

    #[test]
    fn noise_is_not_motion_and_motion_is_found_in_noise() {
        for sigma in [0.0, 0.5e-3, 2e-3, 8e-3] {
            assert!(!judged(sigma, |_| 0.28), "still, noise of {sigma} m");
        }
        let breathing = |i: usize| 0.28 + 4e-3 * (0.1 * i as f64).sin();
        let lifted = |i: usize| if i < 60 { 0.28 } else { 0.27 };
        for sigma in [0.0, 0.5e-3, 1e-3] {
            assert!(judged(sigma, breathing) && judged(sigma, lifted), "noise of {sigma} m");
        }
        // An instrument whose mask misses it for a few frames leaves the median alone.
        assert!(!judged(0.5e-3, |i| if i < 7 { 0.2 } else { 0.28 }));
    }
}
