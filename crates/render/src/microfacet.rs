//! The GGX distribution of facets: what it reflects between two directions, how to choose one, and how much in all.

use crate::material::fresnel;
use glam::Vec3A;
use std::f32::consts::{PI, TAU};

/// Slopes at which energies are kept.
const SLOPES: usize = 48;
/// Samples of each.
const SAMPLES: u32 = 512;

/// Facets of one width. Directions are in the local frame, z the normal, and point away from the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobe {
    width: f32,
}

/// Share of the light from a direction that the facets reflect, summed over all directions it goes to: `scale` times the
/// reflectance head-on plus `offset` (Karis, "Real Shading in Unreal Engine 4", 2013).
#[derive(Clone, Debug)]
pub(crate) struct Table {
    scale: [f32; SLOPES],
    offset: [f32; SLOPES],
}

impl Lobe {
    pub fn new(width: f32) -> Self {
        Self { width }
    }

    /// Reflection without Fresnel's factor times the cosine of `to_light`, the density of [`Self::reflect`], and the cosine
    /// between either direction and the facet (Heitz 2014, "Understanding the Masking-Shadowing Function").
    pub fn between(&self, to_eye: Vec3A, to_light: Vec3A) -> (f32, f32, f32) {
        let half = (to_eye + to_light).normalize_or_zero();
        let a2 = self.width * self.width;
        // 1 - z^2 + a2 z^2, written so that narrow lobes keep their digits.
        let spread = half.x * half.x + half.y * half.y + a2 * half.z * half.z;
        let distribution = a2 / (PI * spread * spread);
        let (eye, light) = (self.masking(to_eye.z), self.masking(to_light.z));
        let value = distribution / (1.0 + eye + light) / (4.0 * to_eye.z);
        let density = distribution / (1.0 + eye) / (4.0 * to_eye.z);
        (value, density, to_eye.dot(half).max(0.0))
    }

    /// Smith's Lambda.
    fn masking(&self, z: f32) -> f32 {
        let z2 = z * z;
        0.5 * ((1.0 + self.width * self.width * (1.0 - z2).max(0.0) / z2).sqrt() - 1.0)
    }

    /// The mirror direction at a facet that is seen from `to_eye`, chosen by its visible area (Dupuy and Benyoub 2023, "Sampling
    /// Visible GGX Normals with Spherical Caps"); `None` where it goes into the surface.
    pub fn reflect(&self, to_eye: Vec3A, a: f32, b: f32) -> Option<Vec3A> {
        let stretched = Vec3A::new(self.width * to_eye.x, self.width * to_eye.y, to_eye.z).normalize();
        let z = (1.0 - b) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (TAU * a).sin_cos();
        let cap = Vec3A::new(radius * cos, radius * sin, z) + stretched;
        let facet = Vec3A::new(self.width * cap.x, self.width * cap.y, cap.z.max(1e-9)).normalize();
        let out = 2.0 * to_eye.dot(facet) * facet - to_eye;
        (out.z > 0.0).then_some(out)
    }
}

impl Table {
    pub fn of(lobe: &Lobe) -> Self {
        let mut table = Self { scale: [0.0; SLOPES], offset: [0.0; SLOPES] };
        for i in 0..SLOPES {
            let z = (i as f32 + 0.5) / SLOPES as f32;
            let to_eye = Vec3A::new((1.0 - z * z).sqrt(), 0.0, z);
            for n in 0..SAMPLES {
                // Hammersley's points.
                let (a, b) = ((n as f32 + 0.5) / SAMPLES as f32, n.reverse_bits() as f32 / 4_294_967_296.0);
                let Some(out) = lobe.reflect(to_eye, a, b) else { continue };
                let (value, density, facing) = lobe.between(to_eye, out);
                let share = value / density / SAMPLES as f32;
                let grazing = fresnel(0.0, facing);
                table.scale[i] += share * (1.0 - grazing);
                table.offset[i] += share * grazing;
            }
        }
        table
    }

    /// Share reflected of light from slope `z`.
    pub fn energy(&self, head_on: f32, z: f32) -> f32 {
        let x = (z * SLOPES as f32 - 0.5).clamp(0.0, SLOPES as f32 - 1.0);
        let i = (x as usize).min(SLOPES - 2);
        let at = |i: usize| head_on * self.scale[i] + self.offset[i];
        at(i) + (x - i as f32) * (at(i + 1) - at(i))
    }

    /// Share reflected of even light from all sides.
    pub fn mean(&self, head_on: f32) -> f32 {
        let sum: f32 = (0..SLOPES)
            .map(|i| (head_on * self.scale[i] + self.offset[i]) * (i as f32 + 0.5) * 2.0 / (SLOPES * SLOPES) as f32)
            .sum();
        sum.min(1.0)
    }
}
