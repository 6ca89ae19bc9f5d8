//! The front of an organ: measured depth inside its mask, cleaned, filled and smoothed.

use crate::fill::fill;
use rayon::prelude::*;
use trocar_camera::{Camera, DepthImage, Mask};

/// Half width of the window of medians and fits (px).
const REACH: usize = 3;

/// Depth of an organ's front at every pixel of its mask.
pub struct Front {
    /// Depth (m); 0 outside the mask.
    pub depth: Vec<f64>,
    /// Pixels whose measured depth was not the organ's (the bed behind an edge, flying pixels).
    pub outliers: usize,
    /// Pixels filled in, outliers included.
    pub filled: usize,
}

/// Cleans, fills and smooths the depth inside `mask`. `radius` (m) is about half the organ's width,
/// `noise` (m) the size of depth errors. `None` without any depth in the mask.
pub fn front(measured: &DepthImage, mask: &Mask, camera: &Camera, radius: f64, noise: f64) -> Option<Front> {
    let mut depth: Vec<f64> =
        measured.depth.iter().zip(&mask.set).map(|(z, set)| if *set { f64::from(*z) } else { 0.0 }).collect();
    let outliers = outliers(&depth, mask, camera, radius, noise);
    for &i in &outliers {
        depth[i] = 0.0;
    }
    let filled = fill(&mut depth, mask)?;
    Some(Front { depth: smooth(&depth, mask, noise), outliers: outliers.len(), filled })
}

/// Pixels farther from the median around them than a round organ allows: within r of its silhouette
/// a profile of radius R drops by at most sqrt(2 R r).
fn outliers(depth: &[f64], mask: &Mask, camera: &Camera, radius: f64, noise: f64) -> Vec<usize> {
    let width = mask.width;
    let is_outlier = |&i: &usize| {
        let mut near: Vec<f64> = window(mask, i).map(|j| depth[j]).filter(|z| *z > 0.0).collect();
        near.sort_by(f64::total_cmp);
        let median = near[near.len() / 2];
        let reach = REACH as f64 * median / camera.fx.min(camera.fy);
        (depth[i] - median).abs() > (2.0 * radius * reach).sqrt() + 3.0 * noise
    };
    (0..width * mask.height).into_par_iter().filter(|&i| mask.set[i] && depth[i] > 0.0).filter(is_outlier).collect()
}

/// Replaces each depth by a quadratic fitted to the mask's pixels around it (weighted least
/// squares, Gaussian of 1.5 px). A quadratic keeps curvature, which an average would flatten. A
/// correction larger than the noise is structure and is not applied.
fn smooth(depth: &[f64], mask: &Mask, noise: f64) -> Vec<f64> {
    let width = mask.width;
    let value = |i: usize| {
        if !mask.set[i] {
            return 0.0;
        }
        let (u, v) = ((i % width) as f64, (i / width) as f64);
        let mut normal = [[0.0; 7]; 6];
        let mut count = 0;
        for j in window(mask, i) {
            let (x, y) = ((j % width) as f64 - u, (j / width) as f64 - v);
            let weight = libm::exp(-(x * x + y * y) / (2.0 * 1.5 * 1.5));
            let row = [1.0, x, y, x * x, x * y, y * y, depth[j] - depth[i]];
            for (a, line) in normal.iter_mut().enumerate() {
                for (b, entry) in line.iter_mut().enumerate() {
                    *entry += weight * row[a] * row[b];
                }
            }
            count += 1;
        }
        let correction = if count < 12 { None } else { solve_first(normal) };
        depth[i] + correction.filter(|c| c.abs() <= 1.5 * noise).unwrap_or(0.0)
    };
    (0..depth.len()).into_par_iter().map(value).collect()
}

/// First unknown of a symmetric 6 x 6 system with its right-hand side in the last column, by
/// elimination; `None` where the pixels do not determine it.
fn solve_first(mut m: [[f64; 7]; 6]) -> Option<f64> {
    // Eliminates from the last unknown to the first, which then stands alone.
    for k in (0..6).rev() {
        if m[k][k].abs() < 1e-9 {
            return None;
        }
        for row in 0..k {
            let factor = m[row][k] / m[k][k];
            for column in 0..7 {
                m[row][column] -= factor * m[k][column];
            }
        }
    }
    Some(m[0][6] / m[0][0])
}

/// Pixels of the mask within REACH of pixel `i`, including itself.
fn window(mask: &Mask, i: usize) -> impl Iterator<Item = usize> + '_ {
    let (w, h) = (mask.width, mask.height);
    let (u, v) = (i % w, i / w);
    (v.saturating_sub(REACH)..(v + REACH + 1).min(h))
        .flat_map(move |y| (u.saturating_sub(REACH)..(u + REACH + 1).min(w)).map(move |x| y * w + x))
        .filter(|&j| mask.set[j])
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_camera::Distortion;

    /// A sphere of 25 mm seen from 300 mm, quantised to 1 mm, with flying pixels and a hole.
    #[test]
    fn quantisation_is_smoothed_without_bias_and_flying_pixels_go() {
        let (w, h, r, d) = (160, 120, 0.025, 0.3);
        let camera =
            Camera { width: w, height: h, fx: 400.0, fy: 400.0, cx: 80.0, cy: 60.0, distortion: Distortion::default() };
        let (mut truth, mut mask) = (vec![0.0; w * h], Mask::new(w, h));
        for i in 0..w * h {
            let ray = camera.ray((i % w) as f64, (i / w) as f64);
            let (a, b) = (ray.length_squared(), d);
            let root = b * b - a * (d * d - r * r);
            if root > 0.0 {
                truth[i] = (b - root.sqrt()) / a;
                mask.set[i] = true;
            }
        }
        let mut measured = DepthImage::new(w, h);
        for i in 0..w * h {
            measured.depth[i] = ((truth[i] * 1000.0).round() / 1000.0) as f32;
        }
        let flying = [60 * w + 82, 61 * w + 90, 55 * w + 70];
        for i in flying {
            measured.depth[i] = 0.40;
        }
        measured.depth[60 * w + 60..60 * w + 66].fill(0.0);
        let front = front(&measured, &mask, &camera, r, 1e-3).unwrap();
        assert_eq!((front.outliers, front.filled), (3, 9));
        let mut errors: Vec<f64> = (0..w * h).filter(|i| mask.set[*i]).map(|i| front.depth[i] - truth[i]).collect();
        let before: f64 = (0..w * h)
            .filter(|i| mask.set[*i] && measured.depth[*i] > 0.0 && !flying.contains(i))
            .map(|i| (f64::from(measured.depth[i]) - truth[i]).abs())
            .sum::<f64>()
            / errors.len() as f64;
        let after = errors.iter().map(|e| e.abs()).sum::<f64>() / errors.len() as f64;
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        assert!(after < 0.75 * before);
        assert!(median.abs() < 0.03e-3);
    }
}
