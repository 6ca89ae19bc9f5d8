//! Surface reflectance: matte, coated (wet tissue, plastic sheet) and metal. All models conserve
//! energy.

mod lanes;

pub(crate) use lanes::{WRAP_LENGTH, only};

use crate::microfacet::{AlbedoTable, GgxLobe, fresnel};
use glam::Vec3A;
use std::f32::consts::PI;

/// Colour and surface reflectance of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// sRGB colour, used if the mesh has no vertex colours.
    pub color: [u8; 3],
    /// Reflectance model.
    pub surface: SurfaceKind,
}

/// Reflectance model of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceKind {
    /// Lambertian.
    Matte,
    /// A clear coat over a diffuse base.
    Coated {
        /// Roughness of the coat, from 0.05 (a film of water) to 1. The GGX width is its square.
        roughness: f32,
        /// Refractive index of the coat, in [1, 3].
        ior: f32,
        /// Mean distance that light travels below the surface before it leaves, for red, green and
        /// blue (m); 0 disables subsurface scattering.
        scattering_length: [f32; 3],
    },
    /// Metal. The colour is its reflectance at normal incidence.
    Metal {
        /// Roughness, from 0.05 (polished) to 1. The GGX width is its square.
        roughness: f32,
    },
}

/// Least roughness that a path sees after its first bounce.
const MIN_PATH_ROUGHNESS: f32 = 0.62;

impl SurfaceKind {
    /// The surface as paths see it after their first bounce. A point light mirrored in a smooth
    /// coat that a path meets by chance is too bright for too few paths, which gives white dots.
    /// With a rougher coat more paths carry less light each, and energy is conserved (Kaplanyan and
    /// Dachsbacher 2013, "Path Space Regularization for Holistic and Robust Light Transport").
    pub(crate) fn for_paths(self) -> Self {
        let rough = |roughness: f32| roughness.max(MIN_PATH_ROUGHNESS);
        match self {
            Self::Matte => Self::Matte,
            Self::Coated { roughness, ior, scattering_length } => {
                Self::Coated { roughness: rough(roughness), ior, scattering_length }
            }
            Self::Metal { roughness } => Self::Metal { roughness: rough(roughness) },
        }
    }
}

impl Appearance {
    /// Wet tissue: a film of water over flesh, in which red light scatters over a few millimetres.
    pub fn tissue(color: [u8; 3]) -> Self {
        Self {
            color,
            surface: SurfaceKind::Coated { roughness: 0.32, ior: 1.36, scattering_length: [1.6e-3, 0.6e-3, 0.4e-3] },
        }
    }

    /// Brushed steel, as of instruments.
    pub fn steel() -> Self {
        Self { color: [196, 193, 188], surface: SurfaceKind::Metal { roughness: 0.42 } }
    }

    /// The silicone sheet of a port.
    pub fn sheet() -> Self {
        Self {
            color: [205, 160, 138],
            surface: SurfaceKind::Coated { roughness: 0.6, ior: 1.43, scattering_length: [0.0; 3] },
        }
    }

    /// A matte surface of one colour.
    pub fn matte(color: [u8; 3]) -> Self {
        Self { color, surface: SurfaceKind::Matte }
    }
}

/// A surface prepared for rendering.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    kind: Kind,
    /// Subsurface scattering length (m).
    pub scattering_length: Vec3A,
}

#[derive(Clone, Debug)]
enum Kind {
    Matte,
    Coated { lobe: GgxLobe, head_on: f32, table: AlbedoTable, base_mean: f32 },
    Metal { lobe: GgxLobe, table: AlbedoTable, mean: f32 },
}

/// The two lobes of a material between two directions. `gloss` and `base` are outgoing radiance per
/// incident radiance, cosine included. The densities are the probabilities per solid angle with
/// which each lobe samples that direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobes {
    pub gloss: Vec3A,
    pub base: Vec3A,
    pub gloss_density: f32,
    pub base_density: f32,
}

impl Material {
    pub fn new(surface: &SurfaceKind) -> Self {
        let width =
            |roughness: f32| GgxLobe::new(if roughness.is_finite() { roughness.clamp(0.05, 1.0).powi(2) } else { 1.0 });
        match *surface {
            SurfaceKind::Matte => Self { kind: Kind::Matte, scattering_length: Vec3A::ZERO },
            SurfaceKind::Metal { roughness } => {
                let lobe = width(roughness);
                let table = AlbedoTable::new(&lobe);
                let mean = table.mean(1.0);
                Self { kind: Kind::Metal { lobe, table, mean }, scattering_length: Vec3A::ZERO }
            }
            SurfaceKind::Coated { roughness, ior, scattering_length } => {
                let lobe = width(roughness);
                let ior = if ior.is_finite() { ior.clamp(1.0, 3.0) } else { 1.4 };
                let head_on = ((ior - 1.0) / (ior + 1.0)).powi(2);
                let table = AlbedoTable::new(&lobe);
                let base_mean = 1.0 - table.mean(head_on);
                let usable = |w: f32| if w.is_finite() { w.clamp(0.0, 0.1) } else { 0.0 };
                let scattering_length = Vec3A::from(scattering_length.map(usable));
                Self { kind: Kind::Coated { lobe, head_on, table, base_mean }, scattering_length }
            }
        }
    }

    pub fn is_metal(&self) -> bool {
        matches!(self.kind, Kind::Metal { .. })
    }

    /// Probability of sampling the gloss lobe, seen from `to_eye` (local frame, z is the normal).
    pub fn gloss_probability(&self, albedo: Vec3A, to_eye: Vec3A) -> f32 {
        match &self.kind {
            Kind::Matte => 0.0,
            Kind::Metal { table, .. } => {
                let single = table.albedo(1.0, to_eye.z);
                single.clamp(0.5, 1.0)
            }
            Kind::Coated { head_on, table, .. } => {
                let gloss = table.albedo(*head_on, to_eye.z);
                let base = (1.0 - gloss) * albedo.max_element();
                (gloss / (gloss + base).max(1e-6)).clamp(0.1, 0.9)
            }
        }
    }

    /// Both lobes between two directions in the local frame.
    pub fn lobes(&self, albedo: Vec3A, to_eye: Vec3A, to_light: Vec3A) -> Lobes {
        let mut lobes = Lobes { gloss: Vec3A::ZERO, base: Vec3A::ZERO, gloss_density: 0.0, base_density: 0.0 };
        let (out, come) = (to_eye.z, to_light.z);
        if out <= 0.0 || come <= 0.0 {
            return lobes;
        }
        lobes.base_density = come / PI;
        match &self.kind {
            Kind::Matte => lobes.base = albedo * (come / PI),
            Kind::Coated { lobe, head_on, table, base_mean } => {
                let (value, density, facing) = lobe.evaluate(to_eye, to_light);
                lobes.gloss = Vec3A::splat(value * fresnel(*head_on, facing));
                lobes.gloss_density = density;
                // Light that passes the coat on the way in passes it again on the way out. A white
                // base with its coat reflects all light.
                let through = (1.0 - table.albedo(*head_on, out)) * (1.0 - table.albedo(*head_on, come));
                lobes.base = albedo * (come / PI * through / base_mean.max(1e-4));
            }
            Kind::Metal { lobe, table, mean } => {
                let (value, density, facing) = lobe.evaluate(to_eye, to_light);
                let tint = albedo + (Vec3A::ONE - albedo) * fresnel(0.0, facing);
                lobes.gloss = tint * value;
                lobes.gloss_density = density;
                // Multiple scattering between facets (Kulla and Conty, "Revisiting Physically Based
                // Shading", 2017).
                let lost = (1.0 - table.albedo(1.0, out)) * (1.0 - table.albedo(1.0, come)) / (1.0 - mean).max(1e-4);
                let average = albedo + (Vec3A::ONE - albedo) / 21.0;
                let again = average * average * *mean / (Vec3A::ONE - average * (1.0 - mean));
                lobes.base = again * (lost * come / PI);
            }
        }
        lobes
    }

    /// [`Lobes::gloss`] alone.
    pub fn gloss(&self, albedo: Vec3A, to_eye: Vec3A, to_light: Vec3A) -> Vec3A {
        match &self.kind {
            Kind::Coated { lobe, head_on, .. } if to_eye.z > 0.0 && to_light.z > 0.0 => {
                let (value, _, facing) = lobe.evaluate(to_eye, to_light);
                Vec3A::splat(value * fresnel(*head_on, facing))
            }
            _ => self.lobes(albedo, to_eye, to_light).gloss,
        }
    }

    /// A sampled direction of the gloss lobe; `None` if it points into the surface.
    pub fn sample_gloss(&self, to_eye: Vec3A, [a, b]: [f32; 2]) -> Option<Vec3A> {
        match &self.kind {
            Kind::Matte => None,
            Kind::Coated { lobe, .. } | Kind::Metal { lobe, .. } => lobe.reflect(to_eye, a, b),
        }
    }
}

/// A direction on the hemisphere, sampled with a density proportional to the cosine.
pub(crate) fn cosine_direction([a, b]: [f32; 2]) -> Vec3A {
    let radius = a.sqrt();
    let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
    Vec3A::new(radius * cos, radius * sin, (1.0 - a).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::numbers;

    /// Total light reflected from one direction into the hemisphere, by the sampling that paths
    /// use.
    fn total_albedo(material: &Material, albedo: Vec3A, slope: f32) -> Vec3A {
        let to_eye = Vec3A::new((1.0 - slope * slope).sqrt(), 0.0, slope);
        const N: u32 = 40_000;
        let mut sum = Vec3A::ZERO;
        for i in 0..N {
            let [choice, a, b, _] = numbers([i, 1, 2, 3]);
            let share = material.gloss_probability(albedo, to_eye);
            if choice < share {
                if let Some(d) = material.sample_gloss(to_eye, [a, b]) {
                    let lobes = material.lobes(albedo, to_eye, d);
                    sum += lobes.gloss / (lobes.gloss_density * share);
                }
            } else {
                let lobes = material.lobes(albedo, to_eye, cosine_direction([a, b]));
                sum += lobes.base / (lobes.base_density * (1.0 - share));
            }
        }
        sum / N as f32
    }

    #[test]
    fn white_materials_reflect_all_light() {
        let mut kinds = vec![SurfaceKind::Matte];
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            kinds.push(SurfaceKind::Metal { roughness });
            for ior in [1.0, 1.36, 2.0] {
                kinds.push(SurfaceKind::Coated { roughness, ior, scattering_length: [0.0; 3] });
            }
        }
        for kind in kinds {
            let material = Material::new(&kind);
            for slope in [0.05, 0.2, 0.5, 0.8, 1.0] {
                let back = total_albedo(&material, Vec3A::ONE, slope);
                assert!((back - Vec3A::ONE).abs().max_element() < 0.01, "{kind:?} at {slope}: {back}");
                let dark = total_albedo(&material, Vec3A::splat(0.3), slope);
                assert!(dark.max_element() < 1.0 && dark.min_element() > 0.1, "{kind:?} at {slope}: {dark}");
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal() {
        let kinds = [
            SurfaceKind::Metal { roughness: 0.5 },
            SurfaceKind::Coated { roughness: 0.4, ior: 1.4, scattering_length: [0.0; 3] },
        ];
        for kind in kinds {
            let material = Material::new(&kind);
            let albedo = Vec3A::new(0.8, 0.4, 0.2);
            for i in 0..200 {
                let n = numbers([i, 4, 5, 6]);
                let (a, b) = (cosine_direction([n[0], n[1]]), cosine_direction([n[2], n[3]]));
                let there = material.lobes(albedo, a, b);
                let back = material.lobes(albedo, b, a);
                let (x, y) = ((there.gloss + there.base) * a.z, (back.gloss + back.base) * b.z);
                assert!((x - y).abs().max_element() <= 1e-4 * (x + y).max_element(), "{kind:?}: {x} {y}");
            }
        }
    }
}
