//! The unseen back: how thick an organ is behind each pixel (paper section III).

use crate::distance_map::distance_map;
use trocar_camera::{Camera, Mask};

/// Thickness along z behind each pixel [m] and the radius it was made with.
pub struct Thickness {
    /// h = 2 sqrt(d (2R - d)), z_back = z_front + h; 0 outside of the mask.
    pub h: Vec<f64>,
    /// R: the 99.5th percentile of d, the distance to the silhouette [m].
    pub radius: f64,
}

/// Models the back of an organ whose front is at `front` [m].
///
/// d is metric at the depth of the organ's middle, z_front + h/2, where a ray passes nearest to the centre of a round
/// profile: measured at the front, a 25 mm sphere seen from 275 mm would come back 10% too small. h follows from d and d
/// from h, so both are iterated; each round shrinks the change by about R/z.
pub fn thickness(front: &[f64], mask: &Mask, camera: &Camera) -> Thickness {
    const ROUNDS: usize = 6;
    // Distances per unit of depth. The silhouette runs half a pixel beyond the centres of the outermost pixels.
    let spacing = [1.0 / camera.fx, 1.0 / camera.fy];
    let half_pixel = 0.25 * (spacing[0] + spacing[1]);
    let angular: Vec<f64> = distance_map(mask, spacing).into_iter().map(|d| d - half_pixel).collect();
    let inside: Vec<usize> = (0..mask.set.len()).filter(|i| mask.set[*i]).collect();
    let mut h = vec![0.0; front.len()];
    let mut radius = 0.0;
    for _ in 0..ROUNDS {
        let mut d: Vec<f64> = inside.iter().map(|&i| angular[i] * (front[i] + 0.5 * h[i])).collect();
        for (&i, d) in inside.iter().zip(&d) {
            h[i] = *d;
        }
        d.sort_by(f64::total_cmp);
        radius = percentile(&d, 0.995);
        for &i in &inside {
            h[i] = 2.0 * (h[i] * (2.0 * radius - h[i])).max(0.0).sqrt();
        }
    }
    Thickness { h, radius }
}

/// Volume between `front` and the back that [`thickness`] models behind it [m3]: what a reconstruction of an organ whose front
/// is known exactly should enclose. Each pixel is a frustum between its front and back depth. `front` is a depth a pixel [m].
pub fn modelled_volume(front: &[f64], mask: &Mask, camera: &Camera) -> f64 {
    let back = thickness(front, mask, camera);
    let frustum = |i: usize| ((front[i] + back.h[i]).powi(3) - front[i].powi(3)) / (3.0 * camera.fx * camera.fy);
    (0..front.len()).filter(|i| mask.set[*i]).map(frustum).sum()
}

/// Percentile `p` (0..=1) of sorted values, linear between neighbours; 0 without values.
fn percentile(sorted: &[f64], p: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = p * last as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    low + (high - low) * at.fract()
}
