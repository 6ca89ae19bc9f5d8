//! The noise of a stereo depth camera such as the D405: what its matching cannot tell, and where it fails.

use rayon::prelude::*;
use trocar_camera::DepthImage;
use trocar_render::random::{normal, numbers};

/// A stereo depth camera's noise. Depth z comes of a disparity of `focal baseline / z` pixels, so that an error in disparity is one of `z^2 / (focal baseline)` in depth
/// (Keselman and others 2017, "Intel RealSense Stereoscopic Depth Cameras", section 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthNoise {
    /// Distance between its two eyes [m].
    pub baseline: f64,
    /// Standard deviation of disparity [px], at the camera's own resolution of 848 pixels.
    pub disparity: f64,
    /// Steps that depth is told in [m].
    pub step: f64,
    /// Nearest depth that it measures [m].
    pub nearest: f64,
    /// Share of pixels without depth where the surface jumps.
    pub dropout: f64,
}

impl Default for DepthNoise {
    /// The D405: 18 mm between its eyes, 0.1 mm steps, 70 mm at least (data sheet); 0.05 px of noise, at which half a metre is known to about 1.6 mm.
    fn default() -> Self {
        Self { baseline: 0.018, disparity: 0.05, step: 1e-4, nearest: 0.07, dropout: 0.6 }
    }
}

/// Width for which `disparity` is told [px].
pub(crate) const OWN_WIDTH: f64 = 848.0;

/// Two neighbours whose depths are apart by more than this share are on different surfaces.
const JUMP: f32 = 0.03;

impl DepthNoise {
    /// Spoils `depth`, measured by eyes with a focal length of `focal` [px] at a width of [`OWN_WIDTH`]; `true_depth` is scratch. `seed` and `frame` choose the noise.
    pub(crate) fn spoil(&self, depth: &mut DepthImage, true_depth: &mut Vec<f32>, focal: f64, [seed, frame]: [u32; 2]) {
        let (width, height) = (depth.width, depth.height);
        true_depth.clear();
        true_depth.extend_from_slice(&depth.depth);
        let spread = self.disparity / (focal * self.baseline);
        let before = &*true_depth;
        depth.depth.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
            for (column, out) in line.iter_mut().enumerate() {
                let z = before[row * width + column];
                if z <= 0.0 {
                    continue;
                }
                let [a, b, c, _] = numbers([(row * width + column) as u32, frame, 0x6465_7074, seed]);
                let apart = |i: usize| {
                    let other = before[i];
                    other <= 0.0 || (other - z).abs() > JUMP * z
                };
                let at = row * width + column;
                let edge = (column > 0 && apart(at - 1))
                    || (column + 1 < width && apart(at + 1))
                    || (row > 0 && apart(at - width))
                    || (row + 1 < height && apart(at + width));
                let noisy = f64::from(z) + f64::from(normal(a, b)[0]) * spread * f64::from(z * z);
                let lost = noisy < self.nearest || (edge && f64::from(c) < self.dropout);
                *out = if lost { 0.0 } else { (self.step * (noisy / self.step).round()) as f32 };
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_grows_with_the_square_of_depth_and_edges_drop_out() {
        let spread = |z: f32| {
            let mut image = DepthImage::new(200, 200);
            image.depth.fill(z);
            DepthNoise::default().spoil(&mut image, &mut Vec::new(), 445.0, [1, 2]);
            let all: Vec<f64> = image.depth.iter().map(|d| f64::from(d - z)).collect();
            (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt()
        };
        let (near, far) = (spread(0.2), spread(0.4));
        assert!((far / near - 4.0).abs() < 0.1, "{near} {far}");
        assert!((0.0008..0.0012).contains(&far), "{far}");

        let mut image = DepthImage::new(64, 64);
        for (i, d) in image.depth.iter_mut().enumerate() {
            *d = if i % 64 < 32 { 0.2 } else { 0.3 };
        }
        DepthNoise::default().spoil(&mut image, &mut Vec::new(), 445.0, [1, 2]);
        let lost = |column: usize| (0..64).filter(|r| image.depth[r * 64 + column] == 0.0).count();
        assert!((25..55).contains(&lost(31)) && (25..55).contains(&lost(32)) && lost(10) == 0 && lost(33) == 0);
        assert!(image.depth.iter().all(|d| (f64::from(*d) / 1e-4 - (f64::from(*d) / 1e-4).round()).abs() < 1e-3));
    }
}
