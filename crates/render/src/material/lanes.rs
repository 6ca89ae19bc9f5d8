//! Materials at eight points at once, for previews.

use super::{Kind, Material};
use crate::lanes::{LANES, Vec8, cross, dot, splat};
use crate::microfacet::GgxLobe;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8, mask32x8};
use std::f32::consts::{FRAC_1_PI, PI};

/// Scattering length at which light reaches half way round (m): the radius of curvature of typical
/// tissue.
pub(crate) const WRAP_LENGTH: f32 = 6e-3;

impl Material {
    /// Outgoing radiance per incident radiance, cosine included, from unit direction `to_light` to
    /// unit direction `to_eye` at points with unit `normal`. Light below the surface wraps around.
    #[inline(always)]
    pub fn lit<S: Simd>(
        &self,
        simd: S,
        albedo: &Vec8<S>,
        normal: &Vec8<S>,
        to_eye: &Vec8<S>,
        to_light: &Vec8<S>,
    ) -> Vec8<S> {
        let zero = splat(simd, 0.0);
        let (out, come) = (dot(*normal, *to_eye), dot(*normal, *to_light));
        let both = out.simd_gt(zero) & come.simd_gt(zero);
        match &self.kind {
            Kind::Matte => {
                let base = both.select(come * FRAC_1_PI, zero);
                [albedo[0] * base, albedo[1] * base, albedo[2] * base]
            }
            Kind::Coated { lobe, head_on, table, base_mean } => {
                let (value, facing) = lobe.lit(simd, normal, to_eye, to_light, out, come);
                let gloss = both.select(value * fresnel(simd, *head_on, facing), zero);
                let mut back = [gloss; 3];
                let lengths = self.scattering_length.to_array();
                if lengths == [0.0; 3] {
                    let (there, again) =
                        (albedo_of(simd, table, *head_on, out), albedo_of(simd, table, *head_on, come));
                    let through = (splat(simd, 1.0) - there) * (splat(simd, 1.0) - again);
                    let base = both.select(come * through * (FRAC_1_PI / base_mean.max(1e-4)), zero);
                    for k in 0..3 {
                        back[k] += albedo[k] * base;
                    }
                } else {
                    for k in 0..3 {
                        let wrap = lengths[k] / (lengths[k] + WRAP_LENGTH);
                        let share = FRAC_1_PI / ((1.0 + wrap) * (1.0 + wrap));
                        back[k] += albedo[k] * ((come + wrap).max(zero) * share);
                    }
                }
                back
            }
            Kind::Metal { lobe, table, mean } => {
                let (value, facing) = lobe.lit(simd, normal, to_eye, to_light, out, come);
                let rim = fresnel(simd, 0.0, facing);
                let one = splat(simd, 1.0);
                let (there, again) = (albedo_of(simd, table, 1.0, out), albedo_of(simd, table, 1.0, come));
                let lost = (one - there) * (one - again) * (1.0 / (1.0 - mean).max(1e-4));
                let mut back = [zero; 3];
                for k in 0..3 {
                    let tint = albedo[k] + (one - albedo[k]) * rim;
                    let average = albedo[k] + (one - albedo[k]) * (1.0 / 21.0);
                    let many = average * average * *mean / (one - average * (1.0 - mean));
                    back[k] = both.select(tint * value + many * (lost * come * FRAC_1_PI), zero);
                }
                back
            }
        }
    }
}

impl GgxLobe {
    /// See [`GgxLobe::evaluate`]: value and cosine at the facet.
    #[inline(always)]
    fn lit<S: Simd>(
        &self,
        simd: S,
        normal: &Vec8<S>,
        to_eye: &Vec8<S>,
        to_light: &Vec8<S>,
        out: f32x8<S>,
        come: f32x8<S>,
    ) -> (f32x8<S>, f32x8<S>) {
        let one = splat(simd, 1.0);
        let sum = [to_eye[0] + to_light[0], to_eye[1] + to_light[1], to_eye[2] + to_light[2]];
        let share = one / dot(sum, sum).sqrt().max(splat(simd, 1e-20));
        let half = [sum[0] * share, sum[1] * share, sum[2] * share];
        let aside = cross(*normal, half);
        let height = dot(*normal, half);
        let a2 = self.width() * self.width();
        let spread = dot(aside, aside) + height * height * a2;
        let distribution = splat(simd, a2) / (spread * spread * PI);
        let (eye, light) = (smith_lambda(simd, a2, out), smith_lambda(simd, a2, come));
        let value = distribution / ((one + eye + light) * (out * 4.0));
        (value, dot(*to_eye, half).max(splat(simd, 0.0)))
    }
}

#[inline(always)]
fn smith_lambda<S: Simd>(simd: S, a2: f32, z: f32x8<S>) -> f32x8<S> {
    let one = splat(simd, 1.0);
    let z2 = z * z;
    let inner = one + (one - z2).max(splat(simd, 0.0)) * a2 / z2;
    (inner.sqrt() - one) * 0.5
}

#[inline(always)]
fn fresnel<S: Simd>(simd: S, head_on: f32, facing: f32x8<S>) -> f32x8<S> {
    let one = splat(simd, 1.0);
    let rest = (one - facing).max(splat(simd, 0.0)).min(one);
    let square = rest * rest;
    square * square * rest * (1.0 - head_on) + head_on
}

#[inline(always)]
fn albedo_of<S: Simd>(simd: S, table: &super::AlbedoTable, head_on: f32, z: f32x8<S>) -> f32x8<S> {
    let mut values: [f32; LANES] = z.into();
    for value in &mut values {
        *value = table.albedo(head_on, *value);
    }
    f32x8::from_slice(simd, &values)
}

/// `on` where `mask` is true, 0 elsewhere.
#[inline(always)]
pub(crate) fn only<S: Simd>(simd: S, mask: mask32x8<S>, on: Vec8<S>) -> Vec8<S> {
    let zero = splat(simd, 0.0);
    [mask.select(on[0], zero), mask.select(on[1], zero), mask.select(on[2], zero)]
}
