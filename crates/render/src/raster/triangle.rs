//! A triangle seen from the eye: the test of eight pixels.

use crate::lanes::{Vec8, cross, dot, minus, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8, u32x8};

/// Eight triangles as seen from the eye, in the camera frame.
///
/// The planes through the eye and the edges face inward, and the plane of the triangle faces away
/// from the eye.
pub(crate) struct Eight<S: Simd> {
    edges: [Vec8<S>; 3],
    plane: Vec8<S>,
    /// Distance of the plane from the eye, times the length of its normal.
    offset: f32x8<S>,
    /// Least and greatest depth of the corners.
    near: f32x8<S>,
    far: f32x8<S>,
}

/// Numbers of [`Eight`] in memory, by lane last.
pub(crate) struct Stored([[f32; 8]; 15]);

/// One triangle in all lanes.
pub(crate) struct One<S: Simd> {
    edges: [Vec8<S>; 3],
    plane: Vec8<S>,
    offset: f32x8<S>,
    near: f32x8<S>,
    far: f32x8<S>,
    number: u32x8<S>,
}

impl<S: Simd> Eight<S> {
    /// Prepares triangles of corners `p` (by corner and axis). Returns the lanes that can be seen
    /// too: with `culled`, only triangles that face the eye. Depths of pixels stay between those of
    /// the corners if `flat`.
    #[inline(always)]
    pub fn new(simd: S, p: &[Vec8<S>; 3], culled: bool, flat: bool) -> (Self, u64) {
        let zero = splat(simd, 0.0);
        let [a, b, c] = *p;
        let plane = cross(minus(b, a), minus(c, a));
        let offset = dot(a, plane);
        let front = offset.simd_lt(zero);
        let seen = if culled { front } else { front | offset.simd_gt(zero) };
        let sign = front.select(splat(simd, -1.0), splat(simd, 1.0));
        let [e, f, g] = [cross(b, c), cross(c, a), cross(a, b)];
        let (near, far) =
            if flat { (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2])) } else { (zero, splat(simd, f32::MAX)) };
        let eight = Self {
            edges: [times(e, sign), times(f, sign), times(g, sign)],
            plane: times(plane, sign),
            offset: offset * sign,
            near,
            far,
        };
        (eight, seen.to_bitmask())
    }

    /// Tests one ray of each triangle: the lanes that meet it, and the ray parameters.
    #[inline(always)]
    pub fn test(&self, simd: S, ray: &Vec8<S>) -> (u64, [f32; 8]) {
        let zero = splat(simd, 0.0);
        let [e, f, g] = [dot(*ray, self.edges[0]), dot(*ray, self.edges[1]), dot(*ray, self.edges[2])];
        let t = (self.offset / dot(*ray, self.plane)).max(self.near).min(self.far);
        let met = e.simd_ge(zero) & f.simd_ge(zero) & g.simd_ge(zero) & t.simd_gt(zero);
        (met.to_bitmask(), t.into())
    }

    #[inline(always)]
    pub fn store(&self) -> Stored {
        let [e, f, g] = self.edges;
        Stored([
            e[0].into(),
            e[1].into(),
            e[2].into(),
            f[0].into(),
            f[1].into(),
            f[2].into(),
            g[0].into(),
            g[1].into(),
            g[2].into(),
            self.plane[0].into(),
            self.plane[1].into(),
            self.plane[2].into(),
            self.offset.into(),
            self.near.into(),
            self.far.into(),
        ])
    }
}

impl Stored {
    #[inline(always)]
    pub fn one<S: Simd>(&self, simd: S, lane: usize, number: u32) -> One<S> {
        let all = &self.0;
        let lane = lane & 7;
        let [e0, e1, e2] = [splat(simd, all[0][lane]), splat(simd, all[1][lane]), splat(simd, all[2][lane])];
        let [f0, f1, f2] = [splat(simd, all[3][lane]), splat(simd, all[4][lane]), splat(simd, all[5][lane])];
        let [g0, g1, g2] = [splat(simd, all[6][lane]), splat(simd, all[7][lane]), splat(simd, all[8][lane])];
        let plane = [splat(simd, all[9][lane]), splat(simd, all[10][lane]), splat(simd, all[11][lane])];
        One {
            edges: [[e0, e1, e2], [f0, f1, f2], [g0, g1, g2]],
            plane,
            offset: splat(simd, all[12][lane]),
            near: splat(simd, all[13][lane]),
            far: splat(simd, all[14][lane]),
            number: u32x8::splat(simd, number),
        }
    }
}

impl<S: Simd> One<S> {
    /// Tests the rays of eight pixels, and keeps the triangle where it is the nearest.
    #[inline(always)]
    pub fn test(&self, simd: S, rays: &[&[f32]; 3], at: usize, depth: &mut [f32], triangle: &mut [u32]) {
        let ray = [
            f32x8::from_slice(simd, &rays[0][at..at + 8]),
            f32x8::from_slice(simd, &rays[1][at..at + 8]),
            f32x8::from_slice(simd, &rays[2][at..at + 8]),
        ];
        let zero = splat(simd, 0.0);
        let (e, f, g) = (dot(ray, self.edges[0]), dot(ray, self.edges[1]), dot(ray, self.edges[2]));
        let inside = e.simd_ge(zero) & f.simd_ge(zero) & g.simd_ge(zero);
        if !inside.any_true() {
            return;
        }
        let t = (self.offset / dot(ray, self.plane)).max(self.near).min(self.far);
        let before = f32x8::from_slice(simd, &depth[at..at + 8]);
        let held = u32x8::from_slice(simd, &triangle[at..at + 8]);
        let nearer = t.simd_lt(before) | (t.simd_eq(before) & self.number.simd_lt(held));
        let nearest = inside & nearer & t.simd_gt(zero);
        nearest.select(t, before).store_slice(&mut depth[at..at + 8]);
        nearest.select(self.number, held).store_slice(&mut triangle[at..at + 8]);
    }

    /// For eight tiles of pixels, between `low` and `high` (by axis), whether any of their rays may
    /// meet the triangle.
    #[inline(always)]
    pub fn may_meet(&self, simd: S, low: &Vec8<S>, high: &Vec8<S>) -> u64 {
        let mut met = f32x8::splat(simd, 0.0).simd_ge(splat(simd, 0.0));
        for plane in [&self.edges[0], &self.edges[1], &self.edges[2], &self.plane] {
            let mut most = splat(simd, 0.0);
            let mut size = splat(simd, 0.0);
            for axis in 0..3 {
                let (a, b) = (plane[axis] * low[axis], plane[axis] * high[axis]);
                most += a.simd_gt(b).select(a, b);
                size = size + a.abs() + b.abs();
            }
            met &= (most + size * 1e-6).simd_ge(splat(simd, 0.0));
        }
        met.to_bitmask()
    }
}

#[inline(always)]
fn times<S: Simd>(a: Vec8<S>, b: f32x8<S>) -> Vec8<S> {
    [a[0] * b, a[1] * b, a[2] * b]
}
