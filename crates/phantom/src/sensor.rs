//! Camera noise, quantisation and holes. All depend on (seed, frame, pixel) alone.

use crate::noise::{key, normal, unit};
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_core::mix;
use trocar_render::srgb;

/// Noise model of the depth camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sensor {
    /// Independent noise per pixel and frame, holes at edges and on steep surfaces, depth in whole
    /// millimetres.
    #[default]
    Plain,
    /// Like `Plain`, with the errors of stereo matching: an error that neighbouring pixels and
    /// successive frames share, and a foreground that extends beyond its silhouette.
    Stereo,
}

/// Unit of recorded depth (m).
pub(crate) const DEPTH_SCALE: f64 = 0.001;
/// Standard deviation of depth at 0.2 m (m). It grows with the square of the distance.
const DEPTH_SIGMA: f32 = 0.3e-3;
/// Standard deviation of a colour channel, of 255.
const COLOR_SIGMA: f32 = 2.0;
/// Cosine between normal and ray below which surfaces lose depth.
const GRAZING: f32 = 0.25;
/// Depth difference between neighbouring pixels that counts as an edge (m).
const EDGE: f32 = 4e-3;
/// Share of pixels lost along edges, and everywhere.
const EDGE_LOSS: f64 = 0.7;
const SPECKLE: f64 = 0.005;

/// Adds noise to a frame. `facing` is the cosine between the surface normal and the ray at each
/// pixel.
pub(crate) fn add_noise(color: &mut ColorImage, depth: &mut DepthImage, facing: &[f32], seed: u64, frame: usize) {
    let (width, height) = (depth.width, depth.height);
    let clean = depth.depth.clone();
    let stream = key(&[seed, 77, frame as u64]);
    for v in 0..height {
        for u in 0..width {
            let i = v * width + u;
            let mut h = mix(stream ^ i as u64);
            let mut next = || {
                h = mix(h);
                h
            };
            let common = 0.8 * normal(next());
            for c in &mut color.pixels[i] {
                let noise = COLOR_SIGMA * (common + 0.6 * normal(next()));
                *c = rounded(f32::from(*c) + noise);
            }
            let z = clean[i];
            if z <= 0.0 {
                continue;
            }
            // A pixel of the rim is its own neighbour beyond.
            let left = clean[i - usize::from(u > 0)];
            let right = clean[i + usize::from(u + 1 < width)];
            let above = clean[if v > 0 { i - width } else { i }];
            let below = clean[if v + 1 < height { i + width } else { i }];
            let edge = [left, right, above, below].map(|near| (near - z).abs() > EDGE).contains(&true);
            let steep = f64::from((GRAZING - facing[i]) / GRAZING).max(0.0);
            let kept = (1.0 - SPECKLE) * (1.0 - steep) * if edge { 1.0 - EDGE_LOSS } else { 1.0 };
            let sigma = DEPTH_SIGMA * (z / 0.2).powi(2);
            let units = f64::from(z + sigma * normal(next())) / DEPTH_SCALE;
            // The nearest whole number, as below.
            let whole = f64::from(units as u32);
            let units = if units - whole >= 0.5 { whole + 1.0 } else { whole };
            depth.depth[i] = if unit(next()) < kept { (units * DEPTH_SCALE) as f32 } else { 0.0 };
        }
    }
}

/// The nearest whole number in [0, 255]; halves go up. The library's function is slow without
/// SSE 4.1.
fn rounded(level: f32) -> u8 {
    let whole = level as u8;
    whole.saturating_add(u8::from(level - f32::from(whole) >= 0.5))
}

/// Brightness at a pixel relative to the lamp's brightness at distance `lamp_distance` (m). The
/// lamp is at the lens; its light fades with distance and towards the corners.
pub(crate) fn lamp_brightness(camera: &Camera, u: f64, v: f64, depth: f32, lamp_distance: f32) -> f32 {
    let (x, y) = ((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
    let off_axis2 = (x * x + y * y) as f32;
    let near = if depth > 0.0 { (lamp_distance / depth).clamp(0.5, 1.5) } else { 1.0 };
    near / (1.0 + 0.9 * off_axis2)
}

/// A colour at another brightness.
pub(crate) fn with_brightness(color: [u8; 3], brightness: f32) -> [u8; 3] {
    srgb::from_linear(srgb::to_linear(color).map(|l| l * brightness))
}

/// `mask` extended by `by` pixels in each direction (a square).
pub(crate) fn dilate(mask: &Mask, by: usize) -> Mask {
    let (width, height) = (mask.width, mask.height);
    let mut rows = vec![false; width * height];
    for v in 0..height {
        let row = &mask.set[v * width..(v + 1) * width];
        for u in (0..width).filter(|u| row[*u]) {
            rows[v * width + u.saturating_sub(by)..v * width + (u + by + 1).min(width)].fill(true);
        }
    }
    let mut grown = Mask::new(width, height);
    for v in 0..height {
        for near in v.saturating_sub(by)..(v + by + 1).min(height) {
            for u in 0..width {
                grown.set[v * width + u] |= rows[near * width + u];
            }
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_specified_magnitude() {
        let (w, h) = (200, 200);
        let mut color = ColorImage::new(w, h, [120; 3]);
        let mut depth = DepthImage::new(w, h);
        depth.depth.fill(0.2003);
        add_noise(&mut color, &mut depth, &vec![1.0; w * h], 5, 9);
        let n = (w * h) as f64;
        let variance = color.pixels.iter().map(|p| (f64::from(p[1]) - 120.0).powi(2)).sum::<f64>() / n;
        assert!((variance.sqrt() - 2.0).abs() < 0.15, "colour sigma {}", variance.sqrt());
        let valid: Vec<f64> = depth.depth.iter().filter(|d| **d > 0.0).map(|d| f64::from(*d)).collect();
        let lost = 1.0 - valid.len() as f64 / n;
        assert!((lost - 0.005).abs() < 0.002, "{lost} lost");
        let mean = valid.iter().sum::<f64>() / valid.len() as f64;
        // Noise of 0.3 steps removes the rounding bias except for exp(-2 (0.3 pi)^2) / pi of a
        // step.
        assert!((mean - 0.2003).abs() < 6e-5, "mean {mean}");
        assert!(valid.iter().all(|d| (d * 1000.0 - (d * 1000.0).round()).abs() < 1e-4), "whole millimetres");
    }

    #[test]
    fn edges_and_grazing_surfaces_lose_depth() {
        let mut depth = DepthImage::new(100, 100);
        for (i, d) in depth.depth.iter_mut().enumerate() {
            *d = if i % 100 < 50 { 0.2 } else { 0.25 };
        }
        let facing: Vec<f32> = (0..10_000).map(|i| if i / 100 < 50 { 1.0 } else { 0.05 }).collect();
        add_noise(&mut ColorImage::new(100, 100, [0; 3]), &mut depth, &facing, 1, 1);
        let lost = |pick: &dyn Fn(usize, usize) -> bool| {
            let chosen: Vec<usize> = (0..10_000).filter(|i| pick(i % 100, i / 100)).collect();
            chosen.iter().filter(|i| depth.depth[**i] == 0.0).count() as f64 / chosen.len() as f64
        };
        assert!(lost(&|u, v| v < 50 && (u == 49 || u == 50)) > 0.5);
        assert!(lost(&|u, v| v < 50 && !(48..52).contains(&u)) < 0.02);
        assert!((lost(&|u, v| v > 50 && !(48..52).contains(&u)) - 0.8).abs() < 0.05);
    }

    #[test]
    fn dilation_extends_a_pixel_to_a_square() {
        let mut mask = Mask::new(9, 9);
        mask.set[4 * 9 + 1] = true;
        let grown = dilate(&mask, 2);
        assert_eq!(grown.count(), 5 * 4, "two to each side, cut at the edge");
        assert!(grown.set[2 * 9] && grown.set[6 * 9 + 3] && !grown.set[4 * 9 + 4]);
    }
}
