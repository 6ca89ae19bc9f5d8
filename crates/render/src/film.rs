//! From light to a picture: exposure, vignette, noise, sRGB.

use crate::random::{normal, numbers};
use crate::rays::RayGenerator;
use crate::srgb;

/// What the sensor and its electronics do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Factor on radiance; 1 shows radiance 1 as white.
    pub exposure: f32,
    /// Loss of light at the picture's rim, 0 to 1, falling with the square of the distance from the middle.
    pub vignette: f32,
    /// Where highlights begin to be compressed, 0 to 1; 1 clips them.
    pub shoulder: f32,
    /// Noise; none if left out.
    pub noise: Option<Noise>,
}

/// A sensor's noise, on linear light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation at white that grows with the root of the light.
    pub shot: f32,
    /// Standard deviation that is there without light.
    pub read: f32,
    /// Seed.
    pub seed: u32,
    /// Number of the frame; each has noise of its own.
    pub frame: u32,
}

impl Default for Film {
    /// Exposure 1, nothing else.
    fn default() -> Self {
        Self { exposure: 1.0, vignette: 0.0, shoulder: 1.0, noise: None }
    }
}

impl Film {
    /// The tower of an endoscope: highlights roll off, corners are darker.
    pub fn endoscope() -> Self {
        Self { exposure: 1.0, vignette: 0.45, shoulder: 0.7, noise: None }
    }

    /// The sRGB colour of a pixel with linear radiance `light`.
    pub(crate) fn develop(&self, eye: &RayGenerator, pixel: usize, light: [f32; 3]) -> [u8; 3] {
        let gain = self.exposure * (1.0 - self.vignette * eye.eccentricity_squared(pixel)).max(0.0);
        let mut values = light.map(|l| l * gain);
        if let Some(noise) = self.noise {
            let [a, b, c, d] = numbers([pixel as u32, noise.frame, 0x6e6f_6973, noise.seed]);
            let ([x, y], [z, _]) = (normal(a, b), normal(c, d));
            for (value, n) in values.iter_mut().zip([x, y, z]) {
                let variance = noise.read * noise.read + noise.shot * noise.shot * value.max(0.0);
                *value += n * variance.sqrt();
            }
        }
        let knee = self.shoulder.clamp(0.0, 1.0);
        srgb::from_linear(values.map(|v| {
            let above = v - knee;
            if above <= 0.0 || knee >= 1.0 { v } else { knee + (1.0 - knee) * (1.0 - (-above / (1.0 - knee)).exp()) }
        }))
    }
}
