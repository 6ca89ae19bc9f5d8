//! Lamps seen from eight points at once, for previews.

use super::Lamp;
use crate::lanes::{Vec8, dot, minus, splat};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8, mask32x8};
use glam::Vec3A;

/// Light that arrives at eight points from the centre of a lamp.
pub(crate) struct Arriving<S: Simd> {
    /// Unit directions towards the lamp.
    pub direction: Vec8<S>,
    /// Distances (m).
    pub distance: f32x8<S>,
    /// Radiance, see [`super::IncidentLight::light`].
    pub light: Vec8<S>,
    /// Where light arrives.
    pub reached: mask32x8<S>,
}

impl Lamp {
    /// Light that arrives at `points` from the centre of the lamp.
    #[inline(always)]
    pub fn arriving_at<S: Simd>(&self, simd: S, points: &Vec8<S>) -> Arriving<S> {
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let to_light = minus(all(simd, self.centre()), *points);
        let square = dot(to_light, to_light);
        let distance = square.sqrt();
        let share = one / distance.max(splat(simd, 1e-12));
        let direction = [to_light[0] * share, to_light[1] * share, to_light[2] * share];
        match *self {
            Self::Spot { direction: axis, intensity, bright, dark, .. } => {
                let share = if dark == f32::NEG_INFINITY {
                    one
                } else {
                    let cos = zero - dot(direction, all(simd, axis));
                    let x = ((cos - dark) * (1.0 / (bright - dark).max(1e-6))).max(zero).min(one);
                    x * x * (splat(simd, 3.0) - x * 2.0)
                };
                let fallen = share / square.max(splat(simd, 1e-12));
                let light = [fallen * intensity.x, fallen * intensity.y, fallen * intensity.z];
                let sum = light[0] + light[1] + light[2];
                let reached = share.simd_gt(zero) & sum.simd_lt(splat(simd, f32::INFINITY));
                Arriving { direction, distance, light, reached }
            }
            Self::Panel { normal, area, radiance, .. } => {
                let cos = (zero - dot(direction, all(simd, normal))) * (1.0 / area);
                let seen = cos * area / square;
                let light = [seen * radiance.x, seen * radiance.y, seen * radiance.z];
                Arriving { direction, distance, light, reached: cos.simd_gt(zero) & distance.simd_gt(zero) }
            }
        }
    }
}

#[inline(always)]
fn all<S: Simd>(simd: S, v: Vec3A) -> Vec8<S> {
    [f32x8::splat(simd, v.x), f32x8::splat(simd, v.y), f32x8::splat(simd, v.z)]
}
