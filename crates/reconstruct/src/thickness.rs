//! Models the unseen back: the thickness of an organ behind each pixel (paper section III).

use crate::BackRule;
use crate::distance_map::distance_map;
use glam::{DMat4, DVec4};
use trocar_camera::{Camera, Mask};

/// Thickness along z behind each pixel (m), and its parameters.
pub struct Thickness {
    /// h = 2 k sqrt(d (2R - d)), z_back = z_front + h; 0 outside the mask.
    pub h: Vec<f64>,
    /// R: the 99.5th percentile of d, the distance to the silhouette (m).
    pub radius: f64,
    /// k: height of the profile over its width; 1 is round.
    pub height_ratio: f64,
}

/// Models the back of an organ whose front is at `front` (m).
///
/// d is metric at the depth of the organ's middle, z_front + h/2, where a ray passes nearest to the
/// centre of a round profile. Measured at the front, a 25 mm sphere seen from 275 mm would become
/// 10% too small. h depends on d and d on h, so both are iterated; each iteration shrinks the
/// change by about R/z.
pub fn thickness(front: &[f64], mask: &Mask, camera: &Camera, rule: BackRule) -> Thickness {
    const ROUNDS: usize = 6;
    // Distances per unit of depth. The silhouette is half a pixel beyond the centres of the
    // outermost pixels.
    let spacing = [1.0 / camera.fx, 1.0 / camera.fy];
    let half_pixel = 0.25 * (spacing[0] + spacing[1]);
    let angular: Vec<f64> = distance_map(mask, spacing).into_iter().map(|d| d - half_pixel).collect();
    let inside: Vec<usize> = (0..mask.set.len()).filter(|i| mask.set[*i]).collect();
    let mut h = vec![0.0; front.len()];
    let (mut radius, mut height_ratio) = (0.0, 1.0);
    for _ in 0..ROUNDS {
        let d: Vec<f64> = inside.iter().map(|&i| angular[i] * (front[i] + 0.5 * h[i])).collect();
        let mut sorted = d.clone();
        sorted.sort_by(f64::total_cmp);
        radius = percentile(&sorted, 0.995);
        let profile: Vec<f64> = d.iter().map(|d| (d * (2.0 * radius - d)).max(0.0).sqrt()).collect();
        if rule == BackRule::Fitted {
            height_ratio = fitted_ratio(front, &inside, &profile, mask.width, camera);
        }
        for (&i, s) in inside.iter().zip(&profile) {
            h[i] = 2.0 * height_ratio * s;
        }
    }
    Thickness { h, radius, height_ratio }
}

/// k of z_front = a + b x + c y - k `profile` by least squares: how far the organ's front rises
/// above a plane through its rim, over how far a round one would. An organ that is as high below
/// its rim as above is then twice that thick.
fn fitted_ratio(front: &[f64], inside: &[usize], profile: &[f64], width: usize, camera: &Camera) -> f64 {
    /// Beyond these limits the fit does not reflect the organ's shape.
    const PLAUSIBLE: std::ops::RangeInclusive<f64> = 0.2..=1.5;
    let row = |k: usize| {
        let i = inside[k];
        let (u, v) = ((i % width) as f64, (i / width) as f64);
        let (x, y) = ((u - camera.cx) / camera.fx * front[i], (v - camera.cy) / camera.fy * front[i]);
        ([1.0, x, y, profile[k]], front[i])
    };
    let (mut normal, mut right) = (DMat4::ZERO, DVec4::ZERO);
    for k in 0..inside.len() {
        let (terms, z) = row(k);
        let terms = DVec4::from_array(terms);
        right += terms * z;
        for column in 0..4 {
            *normal.col_mut(column) += terms * terms[column];
        }
    }
    // With too few pixels it stays round.
    if normal.determinant().abs() < 1e-30 {
        return 1.0;
    }
    let ratio = -(normal.inverse() * right).w;
    if ratio.is_finite() { ratio.clamp(*PLAUSIBLE.start(), *PLAUSIBLE.end()) } else { 1.0 }
}

/// Volume between `front` and the back that is modelled behind it by `rule` (m3): the volume that a
/// reconstruction of an organ with exactly known front should enclose. Each pixel is a frustum
/// between its front and back depth. `front` has a depth per pixel (m). For a camera without
/// distortion.
pub fn modelled_volume(front: &[f64], mask: &Mask, camera: &Camera, rule: BackRule) -> f64 {
    let back = thickness(front, mask, camera, rule);
    let frustum = |i: usize| ((front[i] + back.h[i]).powi(3) - front[i].powi(3)) / (3.0 * camera.fx * camera.fy);
    (0..front.len()).filter(|i| mask.set[*i]).map(frustum).sum()
}

/// Percentile `p` in [0, 1] of sorted values, linear between neighbours; 0 without values.
fn percentile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = p * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    low + (high - low) * at.fract()
}
