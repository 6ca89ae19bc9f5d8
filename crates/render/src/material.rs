//! How surfaces look: matte, coated (wet tissue, plastic sheet) and metal. No material loses or makes light.

use crate::microfacet::{Lobe, Table};
use glam::Vec3A;
use std::f32::consts::PI;

/// Colour and surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// sRGB colour where the mesh has no vertex colours.
    pub color: [u8; 3],
    /// What light does at it.
    pub surface: SurfaceKind,
}

/// What light does at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceKind {
    /// Lambert's.
    Matte,
    /// A clear coat over a scattering body.
    Coated {
        /// Roughness of the coat, 0.05 (a film of water) to 1; the GGX width is its square.
        roughness: f32,
        /// Refractive index of the coat, 1 to 3.
        ior: f32,
        /// How far light wanders below the surface before it comes out, for red, green and blue [m]; 0 for not at all.
        scattering_length: [f32; 3],
    },
    /// Metal; the colour is its reflectance head-on.
    Metal {
        /// Roughness, 0.05 (polished) to 1; the GGX width is its square.
        roughness: f32,
    },
}

/// Least roughness of what paths meet after a bounce.
const BLUNT: f32 = 0.62;

impl SurfaceKind {
    /// As rough as paths find it after their first bounce. A lamp of no size in the mirror of a coat that itself is met by chance is too bright for too few paths, a white dot; in a rougher
    /// coat more paths find less, and energy is kept (Kaplanyan and Dachsbacher 2013, "Path Space Regularization for Holistic and Robust Light Transport").
    pub(crate) fn blunt(self) -> Self {
        let rough = |roughness: f32| roughness.max(BLUNT);
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
    /// Wet tissue: a film of water over flesh, in which red light wanders some millimetres.
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

    /// The silicone sheet that ports go through.
    pub fn sheet() -> Self {
        Self {
            color: [205, 160, 138],
            surface: SurfaceKind::Coated { roughness: 0.6, ior: 1.43, scattering_length: [0.0; 3] },
        }
    }

    /// Matte of a colour.
    pub fn matte(color: [u8; 3]) -> Self {
        Self { color, surface: SurfaceKind::Matte }
    }
}

/// A surface made ready for rendering.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    kind: Kind,
    /// Wandering in the body [m].
    pub scattering_length: Vec3A,
}

#[derive(Clone, Debug)]
enum Kind {
    Matte,
    Coated { lobe: Lobe, head_on: f32, table: Table, body_mean: f32 },
    Metal { lobe: Lobe, table: Table },
}

/// What a material does between two directions: light towards the eye per light that arrives, cosine included, and with which
/// density over solid angle each part would choose that direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    pub gloss: Vec3A,
    pub body: Vec3A,
    pub gloss_density: f32,
    pub body_density: f32,
}

impl Material {
    pub fn new(surface: &SurfaceKind) -> Self {
        let width =
            |roughness: f32| Lobe::new(if roughness.is_finite() { roughness.clamp(0.05, 1.0).powi(2) } else { 1.0 });
        match *surface {
            SurfaceKind::Matte => Self { kind: Kind::Matte, scattering_length: Vec3A::ZERO },
            SurfaceKind::Metal { roughness } => {
                let lobe = width(roughness);
                Self { kind: Kind::Metal { lobe, table: Table::of(&lobe) }, scattering_length: Vec3A::ZERO }
            }
            SurfaceKind::Coated { roughness, ior, scattering_length } => {
                let lobe = width(roughness);
                let ior = if ior.is_finite() { ior.clamp(1.0, 3.0) } else { 1.4 };
                let head_on = ((ior - 1.0) / (ior + 1.0)).powi(2);
                let table = Table::of(&lobe);
                let body_mean = 1.0 - table.mean(head_on);
                let usable = |w: f32| if w.is_finite() { w.clamp(0.0, 0.1) } else { 0.0 };
                let scattering_length = Vec3A::from(scattering_length.map(usable));
                Self { kind: Kind::Coated { lobe, head_on, table, body_mean }, scattering_length }
            }
        }
    }

    pub fn is_metal(&self) -> bool {
        matches!(self.kind, Kind::Metal { .. })
    }

    /// Probability with which a path goes on by the gloss, seen under `to_eye` (local frame, z is the normal).
    pub fn gloss_share(&self, albedo: Vec3A, to_eye: Vec3A) -> f32 {
        match &self.kind {
            Kind::Matte => 0.0,
            Kind::Metal { table, .. } => {
                let single = table.energy(1.0, to_eye.z);
                single.clamp(0.5, 1.0)
            }
            Kind::Coated { head_on, table, .. } => {
                let gloss = table.energy(*head_on, to_eye.z);
                let body = (1.0 - gloss) * albedo.max_element();
                (gloss / (gloss + body).max(1e-6)).clamp(0.1, 0.9)
            }
        }
    }

    /// Both parts between two directions in the local frame.
    pub fn parts(&self, albedo: Vec3A, to_eye: Vec3A, to_light: Vec3A) -> Parts {
        let mut parts = Parts { gloss: Vec3A::ZERO, body: Vec3A::ZERO, gloss_density: 0.0, body_density: 0.0 };
        let (out, come) = (to_eye.z, to_light.z);
        if out <= 0.0 || come <= 0.0 {
            return parts;
        }
        parts.body_density = come / PI;
        match &self.kind {
            Kind::Matte => parts.body = albedo * (come / PI),
            Kind::Coated { lobe, head_on, table, body_mean } => {
                let (value, density, facing) = lobe.between(to_eye, to_light);
                parts.gloss = Vec3A::splat(value * fresnel(*head_on, facing));
                parts.gloss_density = density;
                // What the coat lets in comes out again as it went in: together they keep all light of a white body.
                let through = (1.0 - table.energy(*head_on, out)) * (1.0 - table.energy(*head_on, come));
                parts.body = albedo * (come / PI * through / body_mean.max(1e-4));
            }
            Kind::Metal { lobe, table } => {
                let (value, density, facing) = lobe.between(to_eye, to_light);
                let tint = albedo + (Vec3A::ONE - albedo) * fresnel(0.0, facing);
                parts.gloss = tint * value;
                parts.gloss_density = density;
                // Light that meets more than one facet (Kulla and Conty, "Revisiting Physically Based Shading", 2017).
                let mean = table.mean(1.0);
                let lost = (1.0 - table.energy(1.0, out)) * (1.0 - table.energy(1.0, come)) / (1.0 - mean).max(1e-4);
                let average = albedo + (Vec3A::ONE - albedo) / 21.0;
                let again = average * average * mean / (Vec3A::ONE - average * (1.0 - mean));
                parts.body = again * (lost * come / PI);
            }
        }
        parts
    }

    /// [`Parts::gloss`] alone.
    pub fn gloss(&self, albedo: Vec3A, to_eye: Vec3A, to_light: Vec3A) -> Vec3A {
        match &self.kind {
            Kind::Coated { lobe, head_on, .. } if to_eye.z > 0.0 && to_light.z > 0.0 => {
                let (value, _, facing) = lobe.between(to_eye, to_light);
                Vec3A::splat(value * fresnel(*head_on, facing))
            }
            _ => self.parts(albedo, to_eye, to_light).gloss,
        }
    }

    /// A direction in which a path goes on by the gloss; `None` where it would go into the surface.
    pub fn gloss_direction(&self, to_eye: Vec3A, [a, b]: [f32; 2]) -> Option<Vec3A> {
        match &self.kind {
            Kind::Matte => None,
            Kind::Coated { lobe, .. } | Kind::Metal { lobe, .. } => lobe.reflect(to_eye, a, b),
        }
    }
}

/// A direction over the hemisphere with the cosine's density.
pub(crate) fn body_direction([a, b]: [f32; 2]) -> Vec3A {
    let radius = a.sqrt();
    let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
    Vec3A::new(radius * cos, radius * sin, (1.0 - a).max(0.0).sqrt())
}

/// Schlick's reflectance.
pub(crate) fn fresnel(head_on: f32, facing: f32) -> f32 {
    let rest = (1.0 - facing).clamp(0.0, 1.0);
    head_on + (1.0 - head_on) * rest * rest * rest * rest * rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::numbers;

    /// All light that goes from one direction into the hemisphere, by the very sampling that paths use.
    fn albedo_of(material: &Material, albedo: Vec3A, slope: f32) -> Vec3A {
        let to_eye = Vec3A::new((1.0 - slope * slope).sqrt(), 0.0, slope);
        const N: u32 = 40_000;
        let mut sum = Vec3A::ZERO;
        for i in 0..N {
            let [choice, a, b, _] = numbers([i, 1, 2, 3]);
            let share = material.gloss_share(albedo, to_eye);
            if choice < share {
                if let Some(d) = material.gloss_direction(to_eye, [a, b]) {
                    let parts = material.parts(albedo, to_eye, d);
                    sum += parts.gloss / (parts.gloss_density * share);
                }
            } else {
                let parts = material.parts(albedo, to_eye, body_direction([a, b]));
                sum += parts.body / (parts.body_density * (1.0 - share));
            }
        }
        sum / N as f32
    }

    #[test]
    fn every_white_material_gives_back_all_light() {
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
                let back = albedo_of(&material, Vec3A::ONE, slope);
                assert!((back - Vec3A::ONE).abs().max_element() < 0.01, "{kind:?} at {slope}: {back}");
                let dark = albedo_of(&material, Vec3A::splat(0.3), slope);
                assert!(dark.max_element() < 1.0 && dark.min_element() > 0.1, "{kind:?} at {slope}: {dark}");
            }
        }
    }

    #[test]
    fn light_goes_both_ways_alike() {
        let kinds = [
            SurfaceKind::Metal { roughness: 0.5 },
            SurfaceKind::Coated { roughness: 0.4, ior: 1.4, scattering_length: [0.0; 3] },
        ];
        for kind in kinds {
            let material = Material::new(&kind);
            let albedo = Vec3A::new(0.8, 0.4, 0.2);
            for i in 0..200 {
                let n = numbers([i, 4, 5, 6]);
                let (a, b) = (body_direction([n[0], n[1]]), body_direction([n[2], n[3]]));
                let there = material.parts(albedo, a, b);
                let back = material.parts(albedo, b, a);
                let (x, y) = ((there.gloss + there.body) * a.z, (back.gloss + back.body) * b.z);
                assert!((x - y).abs().max_element() <= 1e-4 * (x + y).max_element(), "{kind:?}: {x} {y}");
            }
        }
    }
}
