//! The GGX microfacet distribution: evaluation, sampling, and directional albedo.

use glam::Vec3A;
use std::f32::consts::{PI, TAU};

/// Number of tabulated cosines.
const COSINES: usize = 48;
/// Samples per tabulated cosine.
const SAMPLES: u32 = 512;

/// A GGX lobe of one width. Directions are in the local frame with the normal along z, and point
/// away from the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GgxLobe {
    width: f32,
}

/// Directional albedo of a lobe: `scale` times the reflectance at normal incidence plus `offset`
/// (Karis, "Real Shading in Unreal Engine 4", 2013).
#[derive(Clone, Debug)]
pub(crate) struct AlbedoTable {
    scale: [f32; COSINES],
    offset: [f32; COSINES],
}

impl GgxLobe {
    pub fn new(width: f32) -> Self {
        Self { width }
    }

    pub fn width(&self) -> f32 {
        self.width
    }

    /// Returns the reflection without the Fresnel factor times the cosine of `to_light`, the
    /// density of [`Self::reflect`], and the cosine between either direction and the facet (Heitz
    /// 2014, "Understanding the Masking-Shadowing Function").
    pub fn evaluate(&self, to_eye: Vec3A, to_light: Vec3A) -> (f32, f32, f32) {
        let half = (to_eye + to_light).normalize_or_zero();
        let a2 = self.width * self.width;
        // 1 - z^2 + a2 z^2, in a form that keeps its digits for narrow lobes.
        let spread = half.x * half.x + half.y * half.y + a2 * half.z * half.z;
        let distribution = a2 / (PI * spread * spread);
        let (eye, light) = (self.smith_lambda(to_eye.z), self.smith_lambda(to_light.z));
        let value = distribution / (1.0 + eye + light) / (4.0 * to_eye.z);
        let density = distribution / (1.0 + eye) / (4.0 * to_eye.z);
        (value, density, to_eye.dot(half).max(0.0))
    }

    /// Smith's Lambda function.
    fn smith_lambda(&self, z: f32) -> f32 {
        let z2 = z * z;
        0.5 * ((1.0 + self.width * self.width * (1.0 - z2).max(0.0) / z2).sqrt() - 1.0)
    }

    /// The mirror direction at a facet sampled by its area visible from `to_eye` (Dupuy and Benyoub
    /// 2023, "Sampling Visible GGX Normals with Spherical Caps"); `None` if it points into the
    /// surface.
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

impl AlbedoTable {
    pub fn new(lobe: &GgxLobe) -> Self {
        let mut table = Self { scale: [0.0; COSINES], offset: [0.0; COSINES] };
        for i in 0..COSINES {
            let z = (i as f32 + 0.5) / COSINES as f32;
            let to_eye = Vec3A::new((1.0 - z * z).sqrt(), 0.0, z);
            for n in 0..SAMPLES {
                // Hammersley points.
                let (a, b) = ((n as f32 + 0.5) / SAMPLES as f32, n.reverse_bits() as f32 / 4_294_967_296.0);
                let Some(out) = lobe.reflect(to_eye, a, b) else { continue };
                let (value, density, facing) = lobe.evaluate(to_eye, out);
                let share = value / density / SAMPLES as f32;
                let grazing = fresnel(0.0, facing);
                table.scale[i] += share * (1.0 - grazing);
                table.offset[i] += share * grazing;
            }
        }
        table
    }

    /// Directional albedo at cosine `z`.
    pub fn albedo(&self, head_on: f32, z: f32) -> f32 {
        let x = (z * COSINES as f32 - 0.5).clamp(0.0, COSINES as f32 - 1.0);
        let i = (x as usize).min(COSINES - 2);
        let at = |i: usize| head_on * self.scale[i] + self.offset[i];
        at(i) + (x - i as f32) * (at(i + 1) - at(i))
    }

    /// Albedo under uniform illumination.
    pub fn mean(&self, head_on: f32) -> f32 {
        let sum: f32 = (0..COSINES)
            .map(|i| (head_on * self.scale[i] + self.offset[i]) * (i as f32 + 0.5) * 2.0 / (COSINES * COSINES) as f32)
            .sum();
        sum.min(1.0)
    }
}

/// Schlick's approximation of the Fresnel reflectance.
pub(crate) fn fresnel(head_on: f32, facing: f32) -> f32 {
    let rest = (1.0 - facing).clamp(0.0, 1.0);
    head_on + (1.0 - head_on) * rest * rest * rest * rest * rest
}
