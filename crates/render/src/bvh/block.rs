//! Intersection of a ray with eight triangles at once.

use super::node::{Bounds, WIDTH};
use super::ray::Ray;
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use glam::Vec3A;

/// Intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    /// Barycentric coordinates of the second and third corner.
    pub u: f32,
    pub v: f32,
    pub triangle: u32,
}

/// Corners of eight triangles, by corner and axis; NaN for unused lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Block {
    pub corners: [[[f32; WIDTH]; 3]; 3],
    pub triangle: [u32; WIDTH],
}

impl Block {
    /// The nearest of eight triangles before `reach`. Two-sided and without gaps between neighbours
    /// (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", 2013).
    #[inline(always)]
    pub fn meet<S: Simd>(&self, simd: S, ray: &Ray, reach: f32) -> Option<Hit> {
        let [kx, ky, kz] = ray.axes;
        let [sx, sy, sz] = ray.shear;
        let (sx, sy, sz) = (f32x8::splat(simd, sx), f32x8::splat(simd, sy), f32x8::splat(simd, sz));
        let origin = ray.origin.to_array();
        let ox = f32x8::splat(simd, origin[kx]);
        let oy = f32x8::splat(simd, origin[ky]);
        let oz = f32x8::splat(simd, origin[kz]);
        let zero = f32x8::splat(simd, 0.0);
        let (mut x, mut y, mut z) = ([zero; 3], [zero; 3], [zero; 3]);
        for c in 0..3 {
            let height = f32x8::from_slice(simd, &self.corners[c][kz]) - oz;
            x[c] = (f32x8::from_slice(simd, &self.corners[c][kx]) - ox) - sx * height;
            y[c] = (f32x8::from_slice(simd, &self.corners[c][ky]) - oy) - sy * height;
            z[c] = sz * height;
        }
        let a = x[2] * y[1] - y[2] * x[1];
        let b = x[0] * y[2] - y[0] * x[2];
        let c = x[1] * y[0] - y[1] * x[0];
        // All of one sign or 0; NaN passes neither test.
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        let inside = low.simd_ge(zero) | high.simd_le(zero);
        if !inside.any_true() {
            return None;
        }
        let sum = a + b + c;
        let t = (a * z[0] + b * z[1] + c * z[2]) / sum;
        let hit = inside & t.simd_gt(zero) & t.simd_lt(f32x8::splat(simd, reach));
        let mut lanes = hit.to_bitmask();
        if lanes == 0 {
            return None;
        }
        let distances: [f32; WIDTH] = t.into();
        let mut best = lanes.trailing_zeros() as usize & (WIDTH - 1);
        lanes &= lanes - 1;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & (WIDTH - 1);
            lanes &= lanes - 1;
            if distances[lane] < distances[best] {
                best = lane;
            }
        }
        let share = 1.0 / sum[best];
        Some(Hit { t: distances[best], u: b[best] * share, v: c[best] * share, triangle: self.triangle[best] })
    }
}

/// Corners of a triangle; `None` if one is missing or not finite.
#[inline]
pub(super) fn corners_of(positions: &[Vec3A], triangle: &[u32; 3]) -> Option<[Vec3A; 3]> {
    let [a, b, c] = triangle.map(|v| positions.get(v as usize).copied().filter(|p| p.is_finite()));
    Some([a?, b?, c?])
}

#[inline]
pub(super) fn bounds_of(positions: &[Vec3A], triangle: &[u32; 3]) -> Option<Bounds> {
    Some(corners_of(positions, triangle)?.into_iter().fold(Bounds::EMPTY, Bounds::with))
}
