//! A band of rows of the picture: the clusters that it may show, and their triangles.

use crate::lanes::{LANES, Vec8, gathered, splat};
use crate::raster::{Cluster, Clusters, Eight, One, View};
use crate::rays::TILE;
use crate::stage::{BodyView, Stage};
use fearless_simd::{
    Simd, SimdBase, SimdCvtTruncate, SimdFloat, SimdInterleaved, SimdMask, SimdSplit, f32x4, f32x8, u32x8,
};
use glam::Vec3A;

/// Images of triangles that are longer than this (px) are sought in tiles of pixels first.
const SMALL: f32 = 16.0;

/// Triangles whose boxes have at most so many pixels are tested eight at a time, the others by
/// eight pixels at a time. A power of two.
const TINY: usize = 4;

/// Places for the vertices of a cluster: one for each number of a byte.
const PLACES: usize = 256;

/// A band of rows.
pub(super) struct Band<'a> {
    view: &'a View<'a>,
    first_row: usize,
    rows: usize,
    /// Rays of the band, by axis.
    rays: [&'a [f32]; 3],
    /// The same rays, one by one.
    each: &'a [[f32; 4]],
    depth: &'a mut [f32],
    triangle: &'a mut [u32],
    /// Inward normals of planes through the eye between which all rays of the band lie; zero where
    /// there is no such plane.
    planes: [Vec3A; 4],
}

/// Vertices of a cluster.
struct Corners {
    /// In the camera frame; the last number is not used.
    place: [[f32; 4]; PLACES],
    /// Image points; the last two numbers are not used.
    image: [[f32; 4]; PLACES],
}

impl<'a> Band<'a> {
    /// The band that starts at `first_row`.
    pub fn new(view: &'a View<'a>, first_row: usize, depth: &'a mut [f32], triangle: &'a mut [u32]) -> Self {
        let stride = view.rays.stride();
        let [x, y, z] = view.rays.axes();
        let held = first_row * stride..first_row * stride + depth.len();
        let each = &view.rays.each()[held.clone()];
        let rays = [&x[held.clone()], &y[held.clone()], &z[held]];
        let rows = depth.len() / stride;
        let planes = planes(view, first_row / TILE..(first_row + rows).div_ceil(TILE));
        Self { view, first_row, rows, rays, each, depth, triangle, planes }
    }

    /// Draws the bodies that `drawn` says.
    #[inline(always)]
    pub fn draw<S: Simd>(&mut self, simd: S, stage: &Stage, drawn: &impl Fn(usize) -> bool) {
        let mut corners = Corners { place: [[0.0; 4]; PLACES], image: [[0.0; 4]; PLACES] };
        for (_, body) in stage.bodies_seen_from(self.view).enumerate().filter(|(k, _)| drawn(*k)) {
            let clusters = body.clusters;
            let culled = clusters.fixed.closed && !body.holds_eye();
            let spheres = &*clusters.spheres;
            for first in (0..spheres[0].len()).step_by(LANES) {
                let mut lanes = self.seen(simd, &body, spheres, first);
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    let cluster = clusters.fixed.clusters[first + lane];
                    self.move_corners(simd, &body, clusters, cluster, &mut corners);
                    self.triangles(simd, &body, clusters, cluster, &corners, culled);
                }
            }
        }
    }

    /// Which of eight clusters may be in the band.
    #[inline(always)]
    fn seen<S: Simd>(&self, simd: S, body: &BodyView<'_>, spheres: &[Vec<f32>; 4], first: usize) -> u64 {
        let centre = body.to_camera(
            simd,
            [
                f32x8::from_slice(simd, &spheres[0][first..first + LANES]),
                f32x8::from_slice(simd, &spheres[1][first..first + LANES]),
                f32x8::from_slice(simd, &spheres[2][first..first + LANES]),
            ],
        );
        let radius = f32x8::from_slice(simd, &spheres[3][first..first + LANES]);
        // The margin covers rounding.
        let reach = radius * 1.0001 + 1e-6;
        let zero = splat(simd, 0.0);
        let mut seen = reach.simd_ge(zero);
        for plane in &self.planes {
            let height = (centre[0] * plane.x + centre[1] * plane.y) + centre[2] * plane.z;
            seen &= (height + reach).simd_ge(zero);
        }
        seen.to_bitmask()
    }

    /// Which of eight triangles of corners `p` lie beyond one of the planes around the band.
    #[inline(always)]
    fn outside<S: Simd>(&self, simd: S, p: &[Vec8<S>; 3]) -> u64 {
        let zero = splat(simd, 0.0);
        let mut outside = 0;
        for plane in &self.planes {
            let mut beyond = u64::MAX;
            for p in p {
                let height = (p[0] * plane.x + p[1] * plane.y) + p[2] * plane.z;
                beyond &= height.simd_lt(zero).to_bitmask();
            }
            outside |= beyond;
        }
        outside
    }

    /// Moves the vertices of a cluster into the camera frame and projects them.
    #[inline(always)]
    fn move_corners<S: Simd>(
        &self,
        simd: S,
        body: &BodyView<'_>,
        clusters: &Clusters,
        cluster: Cluster,
        corners: &mut Corners,
    ) {
        let projection = self.view.rays.projection();
        let [x, y, z] = &*clusters.vertices;
        for k in (0..cluster.vertices as usize).step_by(LANES) {
            let from = cluster.first_vertex as usize + k;
            let p = [
                f32x8::from_slice(simd, &x[from..from + LANES]),
                f32x8::from_slice(simd, &y[from..from + LANES]),
                f32x8::from_slice(simd, &z[from..from + LANES]),
            ];
            let p = body.to_camera(simd, p);
            let image = projection.project(simd, p);
            scatter(simd, p, &mut corners.place[k..k + LANES]);
            scatter(simd, [image[0], image[1], image[1]], &mut corners.image[k..k + LANES]);
        }
    }

    /// Draws the triangles of a cluster.
    #[inline(always)]
    fn triangles<S: Simd>(
        &mut self,
        simd: S,
        body: &BodyView<'_>,
        clusters: &Clusters,
        cluster: Cluster,
        corners: &Corners,
        culled: bool,
    ) {
        let projection = self.view.rays.projection();
        let is_straight = projection.bend == 0.0;
        let last_column = splat(simd, self.view.rays.width() as f32 - 1.0);
        let (top, bottom) = (self.first_row as f32, (self.first_row + self.rows) as f32 - 1.0);
        let fixed = &*clusters.fixed;
        for k in (0..cluster.triangles as usize).step_by(LANES) {
            let first = cluster.first_triangle as usize + k;
            let of = [
                &fixed.corners[0][first..first + LANES],
                &fixed.corners[1][first..first + LANES],
                &fixed.corners[2][first..first + LANES],
            ];
            let [ua, va, _] = gather(simd, &corners.image, of[0]);
            let [ub, vb, _] = gather(simd, &corners.image, of[1]);
            let [uc, vc, _] = gather(simd, &corners.image, of[2]);
            let sum = ((ua + ub) + uc) + ((va + vb) + vc);
            let known = sum.simd_eq(sum);
            let (low_u, high_u) = (ua.min(ub).min(uc), ua.max(ub).max(uc));
            let (low_v, high_v) = (va.min(vb).min(vc), va.max(vb).max(vc));
            let (wide, tall) = (high_u - low_u, high_v - low_v);
            let slack = (wide * wide + tall * tall) * projection.bend + projection.margin;
            let low_u = (low_u - slack).ceil().max(splat(simd, 0.0));
            let high_u = (high_u + slack).floor().min(last_column);
            let low_v = (low_v - slack).ceil().max(splat(simd, top));
            let high_v = (high_v + slack).floor().min(splat(simd, bottom));
            let small = splat(simd, SMALL);
            let large = wide.simd_gt(small) | tall.simd_gt(small);
            let boxed = known & low_u.simd_le(high_u) & low_v.simd_le(high_v);
            let used = (1_u64 << LANES.min(cluster.triangles as usize - k)) - 1;
            // Lines that are bent much may be anywhere.
            let loose = if is_straight { !known.to_bitmask() } else { !known.to_bitmask() | large.to_bitmask() };
            let mut lanes = (boxed.to_bitmask() | loose) & used;
            if culled && is_straight {
                // Backs turn clockwise in the picture, whose y points down.
                let turn = (ub - ua) * (vc - va) - (uc - ua) * (vb - va);
                let back = known & turn.simd_gt((wide + tall) * 1e-3);
                lanes &= !back.to_bitmask();
            }
            if lanes == 0 {
                continue;
            }
            let p = [
                gather(simd, &corners.place, of[0]),
                gather(simd, &corners.place, of[1]),
                gather(simd, &corners.place, of[2]),
            ];
            let (eight, facing) = Eight::new(simd, &p, culled, projection.is_flat());
            lanes &= facing;
            if loose & lanes != 0 {
                lanes &= !(loose & self.outside(simd, &p));
            }
            if lanes == 0 {
                continue;
            }
            let one = splat(simd, 1.0);
            let (columns, rows) = (high_u - low_u + one, high_v - low_v + one);
            let few = (columns * rows).simd_le(splat(simd, TINY as f32)).to_bitmask();
            let tiled = large.to_bitmask() | loose;
            // Lanes without a box hold anything here.
            let low_u: [u32; LANES] = u32x8::truncate_from(low_u).into();
            let high_u: [u32; LANES] = u32x8::truncate_from(high_u).into();
            let low_v: [u32; LANES] = u32x8::truncate_from(low_v - top).into();
            let high_v: [u32; LANES] = u32x8::truncate_from(high_v - top).into();
            let tiny = few & lanes & !loose;
            if tiny != 0 {
                let numbers = (body.first_triangle, &fixed.triangle[first..first + LANES]);
                self.tiny(simd, &eight, tiny, [&low_u, &high_u, &low_v, &high_v], numbers);
                lanes &= !tiny;
                if lanes == 0 {
                    continue;
                }
            }
            let eight = eight.store();
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & (LANES - 1);
                lanes &= lanes - 1;
                let one = eight.one(simd, lane, body.first_triangle + fixed.triangle[first + lane]);
                if loose >> lane & 1 == 1 {
                    self.tiles(simd, &one, [0, self.view.rays.width() - 1], [0, self.rows - 1]);
                    continue;
                }
                let columns = [low_u[lane] as usize, high_u[lane] as usize];
                let rows = [low_v[lane] as usize, high_v[lane] as usize];
                if tiled >> lane & 1 == 1 {
                    self.tiles(simd, &one, columns, rows);
                } else {
                    self.pixels(simd, &one, columns, rows);
                }
            }
        }
    }

    /// Tests triangles in lanes `lanes` whose boxes (first and last column, first and last row)
    /// have at most [`TINY`] pixels: one pixel of each at a time.
    #[inline(always)]
    fn tiny<S: Simd>(
        &mut self,
        simd: S,
        eight: &Eight<S>,
        lanes: u64,
        [low_u, high_u, low_v, high_v]: [&[u32; LANES]; 4],
        (first, numbers): (u32, &[u32]),
    ) {
        let stride = self.view.rays.stride();
        // A place without a ray, for lanes that are done.
        let none = stride - 1;
        let mut places = [[none; LANES]; TINY];
        let mut most = 0;
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize & (LANES - 1);
            left &= left - 1;
            let (low, columns) = (low_u[lane] as usize, (high_u[lane] - low_u[lane]) as usize);
            let (mut place, last) = (low_v[lane] as usize * stride + low, high_v[lane] as usize * stride + low);
            let mut at = 0;
            while place <= last {
                for column in 0..=columns {
                    places[at & (TINY - 1)][lane] = place + column;
                    at += 1;
                }
                place += stride;
            }
            most = most.max(at.min(TINY));
        }
        for places in &places[..most] {
            let [a, b, c, d, e, f, g, h] = *places;
            let each = self.each;
            let ray = gathered(simd, [&each[a], &each[b], &each[c], &each[d], &each[e], &each[f], &each[g], &each[h]]);
            let (met, t) = eight.test(simd, &ray);
            let mut met = met & lanes;
            while met != 0 {
                let lane = met.trailing_zeros() as usize & (LANES - 1);
                met &= met - 1;
                let at = places[lane];
                let number = first + numbers[lane];
                if (t[lane], number) < (self.depth[at], self.triangle[at]) {
                    (self.depth[at], self.triangle[at]) = (t[lane], number);
                }
            }
        }
    }

    /// Tests the pixels of a box, given by first and last column and row of the band.
    #[inline(always)]
    fn pixels<S: Simd>(&mut self, simd: S, one: &One<S>, columns: [usize; 2], rows: [usize; 2]) {
        let stride = self.view.rays.stride();
        for row in rows[0]..=rows[1] {
            let mut u = columns[0];
            while u <= columns[1] {
                one.test(simd, &self.rays, row * stride + u, self.depth, self.triangle);
                u += LANES;
            }
        }
    }

    /// Tests the pixels of those tiles in a box that may show the triangle.
    #[inline(always)]
    fn tiles<S: Simd>(&mut self, simd: S, one: &One<S>, columns: [usize; 2], rows: [usize; 2]) {
        let stride = self.view.rays.stride();
        let tiles = self.view.rays.tiles();
        for row in rows[0] / TILE..=rows[1] / TILE {
            let start = (self.first_row / TILE + row) * tiles.stride;
            let mut first = (columns[0] / TILE) & !(LANES - 1);
            while first <= columns[1] / TILE {
                let at = start + first..start + first + LANES;
                let zero = splat(simd, 0.0);
                let (mut low, mut high) = ([zero; 3], [zero; 3]);
                for axis in 0..3 {
                    low[axis] = f32x8::from_slice(simd, &tiles.low[axis][at.clone()]);
                    high[axis] = f32x8::from_slice(simd, &tiles.high[axis][at.clone()]);
                }
                let mut met = one.may_meet(simd, &low, &high);
                while met != 0 {
                    let column = first + met.trailing_zeros() as usize;
                    met &= met - 1;
                    if column < columns[0] / TILE || column > columns[1] / TILE {
                        continue;
                    }
                    let mut v = (row * TILE).max(rows[0]);
                    while v <= rows[1].min(row * TILE + TILE - 1) {
                        one.test(simd, &self.rays, v * stride + column * TILE, self.depth, self.triangle);
                        v += 1;
                    }
                }
                first += LANES;
            }
        }
    }
}

/// The vectors at eight places.
#[inline(always)]
fn gather<S: Simd>(simd: S, from: &[[f32; 4]; PLACES], at: &[u8]) -> Vec8<S> {
    let Some(at) = at.first_chunk::<LANES>() else { return [splat(simd, 0.0); 3] };
    let [a, b, c, d, e, f, g, h] = *at;
    let (a, b, c, d) = (&from[a as usize], &from[b as usize], &from[c as usize], &from[d as usize]);
    let (e, f, g, h) = (&from[e as usize], &from[f as usize], &from[g as usize], &from[h as usize]);
    gathered(simd, [a, b, c, d, e, f, g, h])
}

/// Stores eight vectors; the fourth number of each is not used.
#[inline(always)]
fn scatter<S: Simd>(simd: S, v: Vec8<S>, to: &mut [[f32; 4]]) {
    let to = to.as_flattened_mut();
    let (low, high) = ([v[0].split(), v[1].split(), v[2].split()], f32x4::splat(simd, 0.0));
    f32x4::store_four_interleaved([low[0].0, low[1].0, low[2].0, high], &mut to[..2 * LANES]);
    f32x4::store_four_interleaved([low[0].1, low[1].1, low[2].1, high], &mut to[2 * LANES..]);
}

/// Inward normals of the planes through the eye that bound the rays of rows of tiles; zero if some
/// ray is not clearly ahead.
fn planes(view: &View<'_>, rows: std::ops::Range<usize>) -> [Vec3A; 4] {
    let tiles = view.rays.tiles();
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for at in rows.start * tiles.stride..rows.end * tiles.stride {
        let (near, far) = (tiles.low[2][at], tiles.high[2][at]);
        if near.is_nan() {
            continue;
        }
        if near < 0.05 {
            return [Vec3A::ZERO; 4];
        }
        for k in 0..2 {
            let (least, most) = (tiles.low[k][at], tiles.high[k][at]);
            low[k] = low[k].min(least / near).min(least / far);
            high[k] = high[k].max(most / near).max(most / far);
        }
    }
    if low[0] > high[0] {
        // No ray at all: an empty cone.
        return [Vec3A::X, -Vec3A::X, Vec3A::Y, Vec3A::NEG_Z];
    }
    [
        Vec3A::new(1.0, 0.0, -low[0]),
        Vec3A::new(-1.0, 0.0, high[0]),
        Vec3A::new(0.0, 1.0, -low[1]),
        Vec3A::new(0.0, -1.0, high[1]),
    ]
    .map(Vec3A::normalize)
}
