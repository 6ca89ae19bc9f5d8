//! Noise of a stereo depth camera: disparity noise, quantisation, and holes where the two views do
//! not match.
//!
//! Every random number depends only on seed, frame and pixel. So the result does not depend on
//! order or threads.

use crate::{Camera, ColorImage, DepthImage, Error, Result};
use glam::DVec3;
use rayon::prelude::*;
use trocar_core::Random;

/// Separates the random numbers of depth from those of other noise: "dept" in ASCII.
const DEPTH_KEY: u64 = 0x6465_7074;

/// The noise of a stereo camera, for example a RealSense D405 ([`DepthNoise::d405`]).
///
/// Depth is z = f b / d with the focal length f along x (px), the baseline b (m) and the disparity
/// d (px). A disparity error sigma_d gives a depth error sigma_z = z^2 sigma_d / (f b) (Intel,
/// "Best-Known-Methods for Tuning Intel RealSense D400 Depth Cameras", depth RMS error).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthNoise {
    /// Distance between the two imagers (m).
    pub baseline: f64,
    /// Standard deviation of the disparity (px).
    pub disparity_sigma: f64,
    /// Quantisation step of the disparity (px); 0 for none.
    pub disparity_step: f64,
    /// Quantisation step of the depth (m); 0 for none.
    pub depth_step: f64,
    /// Smallest and largest reported depth (m).
    pub range: [f64; 2],
    /// A pixel is at an edge if a pixel within `edge_reach` differs by more than this in disparity
    /// (px).
    pub edge_jump: f64,
    /// Half the side of the matching window, within which an edge causes errors (px).
    pub edge_reach: usize,
    /// Fraction of the pixels at edges that become holes.
    pub edge_loss: f64,
    /// Cosine between view and surface normal below which pixels become holes, all of them at 0.
    pub grazing: f64,
    /// A pixel is a highlight if its brightest channel has at least this value. The two imagers see
    /// highlights at different points of a surface.
    pub bright: u8,
    /// Fraction of the pixels in highlights that become holes.
    pub bright_loss: f64,
    /// Fraction of all pixels that become holes at random.
    pub speckle: f64,
    /// Whether points hidden from the second imager, `baseline` to the right, become holes.
    pub occlusion: bool,
}

impl DepthNoise {
    /// A RealSense D405. From the D400 series datasheet: baseline 18 mm, smallest depth 70 mm at
    /// 848 x 480, best up to 0.5 m; reported up to 1 m here. From librealsense: depth in steps of
    /// 0.1 mm. From the tuning guide of the series: a disparity noise of 0.08 px on well-textured
    /// surfaces, that is, 0.4 mm at 0.2 m and 2.5 mm at 0.5 m, within the 2% of the datasheet.
    /// Assumptions of this project, as in the phantoms: disparity in steps of 1/32 px, and all
    /// fractions of holes.
    pub fn d405() -> Self {
        Self {
            baseline: 0.018,
            disparity_sigma: 0.08,
            disparity_step: 1.0 / 32.0,
            depth_step: 1e-4,
            range: [0.07, 1.0],
            edge_jump: 1.0,
            edge_reach: 1,
            edge_loss: 0.7,
            grazing: 0.25,
            bright: 250,
            bright_loss: 0.8,
            speckle: 0.005,
            occlusion: true,
        }
    }

    /// Standard deviation of the depth at depth `z` (m) for `camera`, without quantisation (m).
    pub fn sigma(&self, camera: &Camera, z: f64) -> f64 {
        z * z * self.disparity_sigma / (camera.fx * self.baseline)
    }

    /// The depth image that the sensor reports for the true `depth` of `camera`, in frame number
    /// `frame`. `color` is the picture of the same pixels, which shows the highlights. Model
    /// parameters out of range are clamped. A NaN depth becomes a hole.
    ///
    /// # Errors
    /// Images whose size is not the camera's, or whose number of pixels does not match.
    pub fn apply(
        &self,
        depth: &DepthImage,
        color: Option<&ColorImage>,
        camera: &Camera,
        seed: u64,
        frame: u64,
    ) -> Result<DepthImage> {
        let mut image = depth.clone();
        self.apply_resampled(&mut image, color, camera, camera.fx, [seed, frame])?;
        Ok(image)
    }

    /// As [`Self::apply`], in place, for an image that is a scaled or cropped version of the
    /// imagers' view. `camera` is the camera of the image. `focal` is the focal length of the
    /// imagers (px), whose pixels are the unit of disparity.
    ///
    /// # Errors
    /// As [`Self::apply`]. Then `depth` is unchanged.
    pub fn apply_resampled(
        &self,
        depth: &mut DepthImage,
        color: Option<&ColorImage>,
        camera: &Camera,
        focal: f64,
        [seed, frame]: [u64; 2],
    ) -> Result<()> {
        let (width, height) = (depth.width, depth.height);
        let fits = |w: usize, h: usize, n: usize| (w, h) == (camera.width, camera.height) && n == w * h;
        if !fits(width, height, depth.depth.len()) || color.is_some_and(|c| !fits(c.width, c.height, c.pixels.len())) {
            return Err(Error::Camera(format!(
                "depth has {width} x {height} pixels; depth and colour must have the camera's {} x {}",
                camera.width, camera.height
            )));
        }
        let scale = focal * self.baseline.max(1e-9);
        let disparity: Vec<f64> =
            depth.depth.iter().map(|z| if *z > 0.0 && z.is_finite() { scale / f64::from(*z) } else { 0.0 }).collect();
        let hidden = if self.occlusion { hidden(&disparity, width, camera.fx / focal) } else { Vec::new() };
        let truth = depth.clone();
        let reported = |i: usize| {
            let d = disparity[i];
            if d <= 0.0 || hidden.get(i).is_some_and(|h| *h) {
                return 0.0;
            }
            let mut numbers = Random::from_keys(&[seed, DEPTH_KEY, frame, i as u64]).sequence();
            let mut kept = 1.0 - self.speckle.clamp(0.0, 1.0);
            let facing = facing(&truth, camera, i);
            if facing < self.grazing {
                kept *= facing / self.grazing;
            }
            if at_edge(&disparity, width, i, self.edge_reach, self.edge_jump) {
                kept *= 1.0 - self.edge_loss.clamp(0.0, 1.0);
            }
            if color.is_some_and(|c| c.pixels[i].iter().any(|v| *v >= self.bright)) {
                kept *= 1.0 - self.bright_loss.clamp(0.0, 1.0);
            }
            let lost = numbers.uniform() >= kept;
            let noisy = d + self.disparity_sigma * numbers.normal();
            let z = scale / stepped(noisy, self.disparity_step).max(1e-9);
            let z = stepped(z, self.depth_step);
            if !lost && z >= self.range[0] && z <= self.range[1] { z as f32 } else { 0.0 }
        };
        depth.depth.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
            for (column, pixel) in line.iter_mut().enumerate() {
                *pixel = reported(row * width + column);
            }
        });
        Ok(())
    }
}

impl Default for DepthNoise {
    /// [`Self::d405`].
    fn default() -> Self {
        Self::d405()
    }
}

fn stepped(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// Which pixels are hidden from the right imager: a closer pixel farther right maps to the same or
/// a lower column there. `stretch` is the number of image pixels per imager pixel.
fn hidden(disparity: &[f64], width: usize, stretch: f64) -> Vec<bool> {
    let mut out = vec![false; disparity.len()];
    if width == 0 {
        return out;
    }
    for (row, hidden) in disparity.chunks(width).zip(out.chunks_mut(width)) {
        let mut leftmost = f64::INFINITY;
        for u in (0..row.len()).rev().filter(|u| row[*u] > 0.0) {
            let lands = u as f64 - stretch * row[u];
            // Columns outside the right imager's picture count as visible, because rectified
            // sensors are wider than their pictures.
            hidden[u] = lands >= leftmost;
            leftmost = leftmost.min(lands);
        }
    }
    out
}

fn at_edge(disparity: &[f64], width: usize, i: usize, reach: usize, jump: f64) -> bool {
    let (u, v, height) = (i % width, i / width, disparity.len() / width);
    let span = |at: usize, end: usize| at.saturating_sub(reach)..(at + reach + 1).min(end);
    span(v, height).any(|y| {
        span(u, width).any(|x| {
            let near = disparity[y * width + x];
            near > 0.0 && (near - disparity[i]).abs() > jump
        })
    })
}

/// Cosine between view and surface normal at pixel `i`, from the smaller of the differences to both
/// sides. 1 without neighbours.
fn facing(depth: &DepthImage, camera: &Camera, i: usize) -> f64 {
    let (u, v) = (i % depth.width, i / depth.width);
    let point = |u: usize, v: usize| {
        let z = f64::from(depth.depth[v * depth.width + u]);
        // Lens distortion is negligible for the direction of the normal.
        let ray = DVec3::new((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy, 1.0);
        (z > 0.0 && z.is_finite()).then(|| ray * z)
    };
    let Some(here) = point(u, v) else { return 1.0 };
    let along = |before: Option<DVec3>, after: Option<DVec3>| {
        let differences = [before.map(|p| here - p), after.map(|p| p - here)];
        differences.into_iter().flatten().min_by(|a, b| a.z.abs().total_cmp(&b.z.abs()))
    };
    let x = along(u.checked_sub(1).and_then(|u| point(u, v)), (u + 1 < depth.width).then(|| point(u + 1, v)).flatten());
    let y =
        along(v.checked_sub(1).and_then(|v| point(u, v)), (v + 1 < depth.height).then(|| point(u, v + 1)).flatten());
    match (x, y) {
        (Some(x), Some(y)) => x.cross(y).normalize_or_zero().dot(here.normalize()).abs(),
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera {
        width: 300,
        height: 200,
        fx: 446.8,
        fy: 446.8,
        cx: 149.5,
        cy: 99.5,
        distortion: crate::Distortion([0.0; 8]),
    };

    fn filled(depth: impl Fn(usize, usize) -> f32) -> DepthImage {
        let mut image = DepthImage::new(CAMERA.width, CAMERA.height);
        for (i, z) in image.depth.iter_mut().enumerate() {
            *z = depth(i % CAMERA.width, i / CAMERA.width);
        }
        image
    }

    fn lost(image: &DepthImage, of: impl Fn(usize, usize) -> bool) -> f64 {
        let chosen: Vec<f32> =
            (0..image.depth.len()).filter(|i| of(i % image.width, i / image.width)).map(|i| image.depth[i]).collect();
        chosen.iter().filter(|z| **z == 0.0).count() as f64 / chosen.len() as f64
    }

    #[test]
    fn noise_grows_with_the_square_of_the_distance() {
        let model = DepthNoise { disparity_step: 0.0, depth_step: 0.0, ..DepthNoise::d405() };
        for z in [0.1, 0.2, 0.4] {
            let image = model.apply(&filled(|_, _| z), None, &CAMERA, 7, 0).unwrap();
            let valid: Vec<f64> = image.depth.iter().filter(|z| **z > 0.0).map(|d| f64::from(*d)).collect();
            let mean = valid.iter().sum::<f64>() / valid.len() as f64;
            let deviation = (valid.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / valid.len() as f64).sqrt();
            let expected = f64::from(z * z) * 0.08 / (446.8 * 0.018);
            assert!((model.sigma(&CAMERA, f64::from(z)) - expected).abs() < 1e-9);
            // 60,000 samples: the deviation is known to 0.3%, the mean to 0.4% of a deviation. 1/d
            // is slightly nonlinear.
            assert!((deviation / expected - 1.0).abs() < 0.015, "{z} m: {deviation} not {expected}");
            assert!((mean - f64::from(z)).abs() < 0.05 * expected, "{z} m: mean {mean}");
            let speckle = lost(&image, |_, _| true);
            assert!((speckle - 0.005).abs() < 0.0015, "{speckle} lost on a plane");
        }
    }

    #[test]
    fn depth_is_quantised() {
        let image = DepthNoise::d405().apply(&filled(|u, _| 0.2 + 1e-5 * u as f32), None, &CAMERA, 1, 0).unwrap();
        assert!(image.depth.iter().all(|z| (z * 1e4 - (z * 1e4).round()).abs() < 1e-2), "tenths of millimetres");
        let coarse = DepthNoise { disparity_sigma: 0.0, depth_step: 0.0, speckle: 0.0, ..DepthNoise::d405() };
        let image = coarse.apply(&filled(|_, _| 0.3), None, &CAMERA, 1, 0).unwrap();
        let thirty_seconds = 32.0 * 446.8 * 0.018 / f64::from(image.depth[0]);
        assert!((thirty_seconds - thirty_seconds.round()).abs() < 1e-3, "{thirty_seconds}");
    }

    #[test]
    fn edges_grazing_surfaces_highlights_and_far_points_become_holes() {
        let model = DepthNoise::d405();
        let step = model.apply(&filled(|u, _| if u < 150 { 0.25 } else { 0.2 }), None, &CAMERA, 3, 0).unwrap();
        // 446.8 * 0.018 / 0.2 - 446.8 * 0.018 / 0.25 = 8.04 px beside the closer surface are hidden
        // from the right imager.
        assert_eq!(lost(&step, |u, _| (142..150).contains(&u)), 1.0, "the shadow");
        assert!((lost(&step, |u, _| u == 150) - 0.7).abs() < 0.15, "the edge");
        assert!(lost(&step, |u, _| !(141..151).contains(&u)) < 0.01, "elsewhere");

        // A plane at 84 degrees from its normal in the centre: the fraction 0.1 / 0.25 is kept.
        let slope = (84.26_f64).to_radians().tan();
        let steep = filled(|_, v| (0.3 / (1.0 - slope * (v as f64 - 99.5) / 446.8)).clamp(0.0, 10.0) as f32);
        let image =
            DepthNoise { range: [0.0, 10.0], edge_jump: 50.0, ..model }.apply(&steep, None, &CAMERA, 3, 0).unwrap();
        let kept = 1.0 - lost(&image, |u, v| (140..160).contains(&u) && (97..=102).contains(&v));
        assert!((kept - 0.4).abs() < 0.15, "{kept} kept of the steep plane");

        let mut color = ColorImage::new(CAMERA.width, CAMERA.height, [100; 3]);
        color.pixels[..300 * 50].fill([255, 240, 240]);
        let image = model.apply(&filled(|_, _| 0.2), Some(&color), &CAMERA, 3, 0).unwrap();
        assert!((lost(&image, |_, v| v < 50) - 0.8).abs() < 0.02 && lost(&image, |_, v| v >= 50) < 0.01);
        for z in [0.05, 1.5, f32::NAN, f32::INFINITY, -1.0] {
            let image = model.apply(&filled(|_, _| z), None, &CAMERA, 3, 0).unwrap();
            assert!(image.depth.iter().all(|z| *z == 0.0), "{z} m");
        }
    }

    #[test]
    fn noise_is_reproducible_and_differs_between_frames() {
        let model = DepthNoise::d405();
        let flat = filled(|_, _| 0.2);
        let image = |seed, frame| model.apply(&flat, None, &CAMERA, seed, frame).unwrap();
        assert_eq!(image(1, 4), image(1, 4));
        let differing = |a: &DepthImage, b: &DepthImage| a.depth.iter().zip(&b.depth).filter(|(a, b)| a != b).count();
        assert!(differing(&image(1, 4), &image(1, 5)) > 40_000 && differing(&image(1, 4), &image(2, 4)) > 40_000);
        let other = Camera { width: 10, ..CAMERA };
        assert!(model.apply(&flat, None, &other, 1, 0).unwrap_err().to_string().contains("300 x 200"));
    }

    #[test]
    fn a_cropped_image_has_the_noise_of_the_sensor() {
        let camera = Camera { width: 200, height: 200, fx: 208.0, fy: 208.0, cx: 99.5, cy: 99.5, ..CAMERA };
        let exact = DepthNoise { disparity_step: 0.0, speckle: 0.0, ..DepthNoise::d405() };
        let model = DepthNoise { disparity_sigma: 0.05, edge_loss: 0.6, ..exact };
        let spread = |z: f32| {
            let mut image = DepthImage::new(200, 200);
            image.depth.fill(z);
            model.apply_resampled(&mut image, None, &camera, 445.0, [1, 2]).unwrap();
            let all: Vec<f64> = image.depth.iter().map(|d| f64::from(d - z)).collect();
            (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt()
        };
        let (near, far) = (spread(0.2), spread(0.4));
        assert!((far / near - 4.0).abs() < 0.1, "{near} {far}");
        assert!((0.0008..0.0012).contains(&far), "{far}");

        let camera = Camera { width: 64, height: 64, ..camera };
        let mut image = DepthImage::new(64, 64);
        for (i, d) in image.depth.iter_mut().enumerate() {
            *d = if i % 64 < 32 { 0.2 } else { 0.3 };
        }
        let mut shadowed = image.clone();
        shadowed.depth.iter_mut().for_each(|d| *d = 0.5 - *d);
        model.apply_resampled(&mut image, None, &camera, 445.0, [1, 2]).unwrap();
        let lost = |column: usize| (0..64).filter(|r| image.depth[r * 64 + column] == 0.0).count();
        assert!((25..55).contains(&lost(31)) && (25..55).contains(&lost(32)) && lost(10) == 0 && lost(33) == 0);
        assert!(image.depth.iter().all(|d| (f64::from(*d) / 1e-4 - (f64::from(*d) / 1e-4).round()).abs() < 1e-3));
        // 445 * 0.018 / 0.2 - 445 * 0.018 / 0.3 = 13.4 px of the imagers, 6.2 px of the image, are
        // hidden beside the closer surface on the right.
        model.apply_resampled(&mut shadowed, None, &camera, 445.0, [1, 2]).unwrap();
        let lost = |column: usize| (0..64).filter(|r| shadowed.depth[r * 64 + column] == 0.0).count();
        assert!(lost(26) == 64 && lost(24) == 0, "{} {}", lost(26), lost(24));
    }
}
