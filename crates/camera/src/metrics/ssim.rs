//! Structural similarity (SSIM): Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image
//! Quality Assessment: From Error Visibility to Structural Similarity", IEEE Transactions on Image
//! Processing 13(4), 2004, equation 13.

use super::error::{Error, Result, fits};
use crate::Mask;
use rayon::prelude::*;

/// Half the side of the window of 11 x 11 pixels.
const REACH: usize = 5;
/// Standard deviation of the window's Gaussian (px).
const SIGMA: f64 = 1.5;
/// K1 L and K2 L, squared, with L = 255.
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Structural similarity of two pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Ssim {
    /// Mean over the mask's pixels and the three channels.
    pub mean: f64,
    /// Mean over the channels at each pixel, row by row; NaN outside the mask.
    pub map: Vec<f64>,
}

/// SSIM of two pictures of the mask's size, with three channels in [0, 255] per pixel. The window
/// is a Gaussian of sigma 1.5 px over 11 x 11 pixels, K1 = 0.01 and K2 = 0.03, with weighted,
/// uncorrected variances, as in the publication. Only pixels of the mask have weight in a window,
/// so pixels outside the mask have no effect. At five or more pixels inside the mask, the map
/// equals that of the whole pictures.
///
/// # Errors
/// Different sizes, or an empty mask.
pub fn ssim(a: &[[f64; 3]], b: &[[f64; 3]], mask: &Mask) -> Result<Ssim> {
    let size = (mask.width, mask.height);
    fits("the mask", (mask.width, mask.height, mask.set.len()), size)?;
    for (what, picture) in [("the first picture", a), ("the second picture", b)] {
        fits(what, (mask.width, mask.height, picture.len()), size)?;
    }
    let count = mask.count();
    if count == 0 {
        return Err(Error::Empty);
    }
    let inside = |i: usize| if mask.set[i] { 1.0 } else { 0.0 };
    let weight = blur(&(0..mask.set.len()).map(inside).collect::<Vec<f64>>(), mask.width);
    let channels: Vec<Vec<f64>> = (0..3_usize)
        .into_par_iter()
        .map(|c| {
            let of = |f: &dyn Fn(f64, f64) -> f64| {
                let plane: Vec<f64> =
                    (0..a.len()).map(|i| if mask.set[i] { f(a[i][c], b[i][c]) } else { 0.0 }).collect();
                blur(&plane, mask.width)
            };
            let (x, y) = (of(&|x, _| x), of(&|_, y| y));
            let (xx, yy, xy) = (of(&|x, _| x * x), of(&|_, y| y * y), of(&|x, y| x * y));
            let at = |i: usize| {
                if !mask.set[i] {
                    return f64::NAN;
                }
                let [x, y, xx, yy, xy] = [x[i], y[i], xx[i], yy[i], xy[i]].map(|v| v / weight[i]);
                let (vx, vy, cov) = (xx - x * x, yy - y * y, xy - x * y);
                (2.0 * x * y + C1) * (2.0 * cov + C2) / ((x * x + y * y + C1) * (vx + vy + C2))
            };
            (0..a.len()).map(at).collect()
        })
        .collect();
    let map: Vec<f64> = (0..a.len()).map(|i| channels.iter().map(|c| c[i]).sum::<f64>() / 3.0).collect();
    let mean = (0..map.len()).filter(|i| mask.set[*i]).map(|i| map[i]).sum::<f64>() / count as f64;
    Ok(Ssim { mean, map })
}

/// Applies the window to a plane, by rows and then by columns. Pixels beyond the border have no
/// weight.
fn blur(plane: &[f64], width: usize) -> Vec<f64> {
    let window: Vec<f64> =
        (0..=2 * REACH).map(|k| libm::exp(-0.5 * ((k as f64 - REACH as f64) / SIGMA).powi(2))).collect();
    let sum: f64 = window.iter().sum();
    let window: Vec<f64> = window.iter().map(|w| w / sum).collect();
    let height = plane.len() / width.max(1);
    let mut rows = vec![0.0; plane.len()];
    for (to, from) in rows.chunks_mut(width).zip(plane.chunks(width)) {
        for u in 0..width {
            let first = u.saturating_sub(REACH);
            let last = (u + REACH + 1).min(width);
            to[u] = (first..last).map(|x| window[x + REACH - u] * from[x]).sum();
        }
    }
    let mut out = vec![0.0; plane.len()];
    for v in 0..height {
        for y in v.saturating_sub(REACH)..(v + REACH + 1).min(height) {
            let w = window[y + REACH - v];
            let (to, from) = (&mut out[v * width..(v + 1) * width], &rows[y * width..(y + 1) * width]);
            to.iter_mut().zip(from).for_each(|(to, from)| *to += w * from);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn whole(width: usize, height: usize) -> Mask {
        Mask { width, height, set: vec![true; width * height] }
    }

    #[test]
    fn identical_and_uniform_pictures_have_their_known_ssim() {
        let picture: Vec<[f64; 3]> = (0..40 * 30).map(|i| [(i * 37 % 251) as f64, (i % 7) as f64, 9.0]).collect();
        assert!((ssim(&picture, &picture, &whole(40, 30)).unwrap().mean - 1.0).abs() < 1e-12);
        let (a, b) = (vec![[100.0; 3]; 1200], vec![[150.0; 3]; 1200]);
        let expected = (2.0 * 100.0 * 150.0 + C1) / (100.0 * 100.0 + 150.0 * 150.0 + C1);
        assert!((ssim(&a, &b, &whole(40, 30)).unwrap().mean - expected).abs() < 1e-9);
    }

    #[test]
    fn pixels_outside_the_mask_have_no_effect() {
        let mut mask = whole(40, 30);
        (0..1200).for_each(|i| mask.set[i] = i % 40 < 21 && i / 40 > 3);
        let picture = |seed: usize, beside: f64| -> Vec<[f64; 3]> {
            (0..1200).map(|i| if mask.set[i] { [(i * seed % 256) as f64; 3] } else { [beside; 3] }).collect()
        };
        let [dark, light] = [0.0, 255.0].map(|beside| ssim(&picture(31, beside), &picture(97, 255.0 - beside), &mask));
        let (dark, light) = (dark.unwrap(), light.unwrap());
        assert_eq!(dark.mean, light.mean);
        assert!(dark.mean < 0.5 && dark.map[0].is_nan() && dark.map[15 * 40 + 3].is_finite());
        assert_eq!(ssim(&picture(1, 0.0), &picture(1, 0.0), &Mask::new(40, 30)), Err(Error::Empty));
        assert!(ssim(&picture(1, 0.0)[1..], &picture(1, 0.0), &mask).is_err());
    }
}
