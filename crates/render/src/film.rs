//! From radiance to a picture: exposure, vignette, noise, sRGB.

use crate::random::{normal, numbers};
use crate::rays::RayGenerator;
use crate::srgb::Encoder;

/// Response of the image sensor and its electronics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Factor on radiance. With exposure 1, radiance 1 is white.
    pub exposure: f32,
    /// Loss of light at the rim of the picture, in [0, 1]. It grows with the square of the distance
    /// from the centre.
    pub vignette: f32,
    /// Level at which highlight compression starts, in [0, 1]; 1 clips highlights.
    pub shoulder: f32,
    /// Sensor noise; `None` for a noise-free picture.
    pub noise: Option<Noise>,
}

/// Noise of an image sensor, added to linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the shot noise at white. It scales with the square root of the light.
    pub shot: f32,
    /// Standard deviation of the read noise, independent of the light.
    pub read: f32,
    /// Seed.
    pub seed: u32,
    /// Frame number. Each frame has its own noise.
    pub frame: u32,
}

/// Pixels whose gain is computed together.
const CHUNK: usize = 32;

impl Default for Film {
    /// Exposure 1, no vignette, no highlight compression, no noise.
    fn default() -> Self {
        Self { exposure: 1.0, vignette: 0.0, shoulder: 1.0, noise: None }
    }
}

impl Film {
    /// The camera processor of an endoscope: compressed highlights and darker corners.
    pub fn endoscope() -> Self {
        Self { exposure: 1.0, vignette: 0.45, shoulder: 0.7, noise: None }
    }

    /// The sRGB colours of pixels of a row, from pixel `first`, `v`, of a picture with linear
    /// radiance `light`.
    pub(crate) fn develop(
        &self,
        rays: &RayGenerator,
        [first, v]: [usize; 2],
        light: &[[f32; 3]],
        colors: &mut [[u8; 3]],
    ) {
        let encoder = Encoder::new();
        let knee = self.shoulder.clamp(0.0, 1.0);
        let mut gains = [0.0; CHUNK];
        for (u, (color, light)) in colors.iter_mut().zip(light).enumerate() {
            if u % CHUNK == 0 {
                for (k, gain) in gains.iter_mut().enumerate() {
                    *gain =
                        self.exposure * (1.0 - self.vignette * rays.eccentricity_squared(first + u + k, v)).max(0.0);
                }
            }
            let gain = gains[u % CHUNK];
            let mut values = [light[0] * gain, light[1] * gain, light[2] * gain];
            if let Some(noise) = self.noise {
                let [a, b, c, d] =
                    numbers([(v * rays.width() + first + u) as u32, noise.frame, 0x6e6f_6973, noise.seed]);
                let ([x, y], [z, _]) = (normal(a, b), normal(c, d));
                for (value, n) in values.iter_mut().zip([x, y, z]) {
                    let variance = noise.read * noise.read + noise.shot * noise.shot * value.max(0.0);
                    *value += n * variance.sqrt();
                }
            }
            for k in 0..3 {
                let above = values[k] - knee;
                let bent = above > 0.0 && knee < 1.0;
                let rest = 1.0 - knee;
                let value = if bent { knee + rest * (1.0 - (-above / rest).exp()) } else { values[k] };
                color[k] = encoder.encode(value);
            }
        }
    }
}
