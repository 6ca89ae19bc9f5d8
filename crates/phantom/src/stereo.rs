//! Errors of stereo matching: spatially and temporally correlated noise, and fattened edges.
//!
//! A matcher compares windows of several pixels, so its error is smooth over about a window. The
//! texture it matches does not move, so the error persists, except for a slow drift with light and
//! temperature. A window that contains an edge matches the foreground, which extends beyond its
//! silhouette by a pixel or two.

use crate::noise::{key, smooth};
use glam::DVec3;
use trocar_camera::DepthImage;

/// Standard deviation of the correlated error at distance [`SIGMA_AT`] (m). It grows with the
/// square of the distance.
const SIGMA: f64 = 0.5e-3;
const SIGMA_AT: f64 = 0.28;
/// Correlation length of the error (px).
const WINDOW: f64 = 8.0;
/// Frames over which the drifting part changes.
const DRIFT_FRAMES: f64 = 60.0;
/// Share of the variance that drifts; the rest is constant.
const DRIFT_SHARE: f64 = 0.3;
/// Standard deviation of [`smooth`] over the plane with a third coordinate of one half, and over
/// space (measured).
const PLANE_SIGMA: f64 = 0.303;
const SPACE_SIGMA: f64 = 0.370;
/// Depth difference at which the foreground fattens (m).
const EDGE_STEP: f32 = 4e-3;

/// Adds the stereo error to the depth of frame `index`, before the noise of single pixels.
pub(crate) fn add_error(depth: &mut DepthImage, seed: u64, index: usize) {
    fatten_foreground(depth, key(&[seed, 78]));
    let (width, stays, drifts) = (depth.width, key(&[seed, 79]), key(&[seed, 80]));
    let (still, moving) = (SIGMA * (1.0 - DRIFT_SHARE).sqrt() / PLANE_SIGMA, SIGMA * DRIFT_SHARE.sqrt() / SPACE_SIGMA);
    let time = index as f64 / DRIFT_FRAMES;
    for (i, z) in depth.depth.iter_mut().enumerate().filter(|(_, z)| **z > 0.0) {
        let (u, v) = ((i % width) as f64 / WINDOW, (i / width) as f64 / WINDOW);
        let error = still * smooth(stays, DVec3::new(u, v, 0.5)) + moving * smooth(drifts, DVec3::new(u, v, time));
        *z += (error * (f64::from(*z) / SIGMA_AT).powi(2)) as f32;
    }
}

/// Extends near surfaces over far ones by one pixel, or by two where texture is poor.
fn fatten_foreground(depth: &mut DepthImage, seed: u64) {
    let (width, height) = (depth.width, depth.height);
    let clean = depth.depth.clone();
    for v in 0..height {
        for u in 0..width {
            let z = clean[v * width + u];
            let poor = || smooth(seed, DVec3::new(u as f64 / WINDOW, v as f64 / WINDOW, 0.5)) > 0.0;
            let mut nearest = z;
            // Texture is evaluated only where a surface two pixels away matters.
            for (reach, counts) in [(1, true), (2, false)] {
                let rows = v.saturating_sub(reach)..(v + reach + 1).min(height);
                let columns = u.saturating_sub(reach)..(u + reach + 1).min(width);
                let near = rows.flat_map(|y| clean[y * width + columns.start..y * width + columns.end].iter());
                let near = near.copied().filter(|n| *n > 0.0).fold(f32::INFINITY, f32::min);
                if near + EDGE_STEP < nearest && (counts || poor()) {
                    nearest = near;
                }
            }
            if z > 0.0 {
                depth.depth[v * width + u] = nearest;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(z: f32, frame: usize) -> Vec<f64> {
        let mut depth = DepthImage::new(400, 300);
        depth.depth.fill(z);
        add_error(&mut depth, 3, frame);
        depth.depth.iter().map(|d| f64::from(d - z)).collect()
    }

    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64
    }

    #[test]
    fn stereo_error_has_its_magnitude_and_correlations() {
        let error = flat(0.28, 0);
        let rms = product(&error, &error).sqrt();
        assert!((rms - SIGMA).abs() < 0.1 * SIGMA, "rms {rms}");
        let far = flat(0.56, 0);
        assert!((product(&far, &far).sqrt() / rms - 4.0).abs() < 0.01);
        let shifted = |by: usize| product(&error[by..], &error[..error.len() - by]) / (rms * rms);
        assert!(shifted(2) > 0.8, "two pixels on: {}", shifted(2));
        assert!(shifted(20).abs() < 0.1, "twenty pixels on: {}", shifted(20));
        let later = |frame: usize| product(&error, &flat(0.28, frame)) / (rms * rms);
        assert!(later(5) > 0.95, "five frames on: {}", later(5));
        assert!(later(300) > 0.5 && later(300) < 0.85, "ten seconds on: {}", later(300));
    }

    #[test]
    fn foreground_fattens_by_one_or_two_pixels() {
        let mut depth = DepthImage::new(100, 100);
        for (i, d) in depth.depth.iter_mut().enumerate() {
            *d = if i % 100 < 50 { 0.2 } else { 0.25 };
        }
        fatten_foreground(&mut depth, 1);
        let mut two = 0;
        for row in depth.depth.chunks(100) {
            assert!(row[49] == 0.2 && row[50] == 0.2 && row[52] == 0.25);
            two += usize::from(row[51] == 0.2);
        }
        assert!(two > 20 && two < 80, "{two} rows of 100 by two pixels");
    }
}
