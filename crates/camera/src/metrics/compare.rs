//! All metrics of one picture against another.

use super::error::{Error, Result, fits};
use super::exposure::match_exposure;
use super::ssim::ssim;
use crate::{ColorImage, Mask};
use serde::Serialize;

/// Similarity of a picture to a target within a mask.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// Structural similarity; 1 for identical pictures.
    pub ssim: f64,
    /// Peak signal-to-noise ratio (dB); infinite for identical pictures (`null` in JSON).
    pub psnr_db: f64,
    /// Structural similarity after [`match_exposure`].
    pub ssim_matched: f64,
    /// Peak signal-to-noise ratio after [`match_exposure`] (dB).
    pub psnr_matched_db: f64,
    /// Exposure gains of red, green and blue.
    pub gains: [f64; 3],
}

/// Compares `picture` with `target` within `mask`.
///
/// # Errors
/// Different sizes, or an empty mask.
pub fn compare(target: &ColorImage, picture: &ColorImage, mask: &Mask) -> Result<ImageMetrics> {
    let size = (mask.width, mask.height);
    fits("the target", (target.width, target.height, target.pixels.len()), size)?;
    fits("the picture", (picture.width, picture.height, picture.pixels.len()), size)?;
    fits("the mask", (mask.width, mask.height, mask.set.len()), size)?;
    let [target, picture] =
        [target, picture].map(|image| -> Vec<[f64; 3]> { image.pixels.iter().map(|p| p.map(f64::from)).collect() });
    let matched = match_exposure(&picture, &target, mask)?;
    Ok(ImageMetrics {
        ssim: ssim(&target, &picture, mask)?.mean,
        psnr_db: psnr_db(&target, &picture, mask)?,
        ssim_matched: ssim(&target, &matched.picture, mask)?.mean,
        psnr_matched_db: psnr_db(&target, &matched.picture, mask)?,
        gains: matched.gains,
    })
}

/// Peak signal-to-noise ratio 10 log10(255^2 / mean squared difference) over the mask's pixels and
/// the three channels (dB). Infinite without a difference.
///
/// # Errors
/// Different sizes, or an empty mask.
pub fn psnr_db(a: &[[f64; 3]], b: &[[f64; 3]], mask: &Mask) -> Result<f64> {
    let size = (mask.width, mask.height);
    fits("the mask", (mask.width, mask.height, mask.set.len()), size)?;
    fits("the first picture", (mask.width, mask.height, a.len()), size)?;
    fits("the second picture", (mask.width, mask.height, b.len()), size)?;
    let count = mask.count();
    if count == 0 {
        return Err(Error::Empty);
    }
    let squares = |i: usize| (0..3).map(|c| (a[i][c] - b[i][c]).powi(2)).sum::<f64>();
    let sum: f64 = (0..a.len()).filter(|i| mask.set[*i]).map(squares).sum();
    Ok(10.0 * libm::log10(255.0 * 255.0 * 3.0 * count as f64 / sum))
}

/// A uniform picture with the rounded mean colour of the mask's pixels: a baseline that shows only
/// the colour.
///
/// # Errors
/// Different sizes, or an empty mask.
pub fn mean_colour(picture: &ColorImage, mask: &Mask) -> Result<ColorImage> {
    let size = (mask.width, mask.height);
    fits("the mask", (mask.width, mask.height, mask.set.len()), size)?;
    fits("the picture", (picture.width, picture.height, picture.pixels.len()), size)?;
    let count = mask.count();
    if count == 0 {
        return Err(Error::Empty);
    }
    let mut sum = [0_u64; 3];
    for (p, _) in picture.pixels.iter().zip(&mask.set).filter(|(_, set)| **set) {
        (0..3).for_each(|c| sum[c] += u64::from(p[c]));
    }
    let mean = sum.map(|s| (s as f64 / count as f64).round() as u8);
    Ok(ColorImage::new(picture.width, picture.height, mean))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn textured() -> (ColorImage, Mask) {
        let mut picture = ColorImage::new(50, 40, [0; 3]);
        for (i, p) in picture.pixels.iter_mut().enumerate() {
            *p = [(40 + i * 31 % 80) as u8, (30 + i * 17 % 60) as u8, (20 + i * 7 % 50) as u8];
        }
        let mut mask = Mask::new(50, 40);
        (0..2000).for_each(|i| mask.set[i] = i % 50 > 9 && i / 50 < 30);
        (picture, mask)
    }

    #[test]
    fn exposure_is_matched_channel_by_channel() {
        let (target, mask) = textured();
        let mut picture = target.clone();
        picture.pixels.iter_mut().for_each(|p| *p = [2 * p[0], p[1], p[2] * 3 / 2]);
        let metrics = compare(&target, &picture, &mask).unwrap();
        assert!(metrics.psnr_db < 18.0 && metrics.psnr_matched_db > 50.0, "{metrics:?}");
        assert!(metrics.ssim < 0.95 && metrics.ssim_matched > 0.999, "{metrics:?}");
        assert!((metrics.gains[0] - 0.5).abs() < 1e-9 && (metrics.gains[1] - 1.0).abs() < 1e-9, "{metrics:?}");
        assert_eq!(compare(&target, &target, &mask).unwrap().psnr_db, f64::INFINITY);
    }

    #[test]
    fn a_known_difference_has_its_psnr() {
        let (target, mask) = textured();
        let mut picture = target.clone();
        picture.pixels.iter_mut().for_each(|p| *p = p.map(|v| v + 5));
        // Pixels outside the mask do not count.
        picture.pixels[0] = [255; 3];
        let metrics = compare(&target, &picture, &mask).unwrap();
        assert!((metrics.psnr_db - 20.0 * (255.0_f64 / 5.0).log10()).abs() < 1e-9);
    }

    #[test]
    fn mean_colour_is_that_of_the_mask() {
        let (mut picture, mask) = textured();
        for (p, set) in picture.pixels.iter_mut().zip(&mask.set) {
            *p = if *set { [10, 20, 31] } else { [200; 3] };
        }
        assert_eq!(mean_colour(&picture, &mask).unwrap(), ColorImage::new(50, 40, [10, 20, 31]));
        assert_eq!(mean_colour(&picture, &Mask::new(50, 40)), Err(Error::Empty));
        assert!(compare(&picture, &ColorImage::new(50, 39, [0; 3]), &mask).is_err());
    }
}
