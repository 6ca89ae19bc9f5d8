//! Direct light on what was rasterised: eight pixels of a body at a time.

use crate::bvh::Stacks;
use crate::direct::{BESIDE_EYE_SHARE, SHADOW_RAY_END};
use crate::material::only;
use crate::picture::Rows;
use crate::raster::{LANES, NOTHING, Vec8, View, Visibility, dot, splat};
use crate::rays::TILE;
use crate::shading_frame::offset;
use crate::stage::{BundleCandidates, Stage};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x8};
use glam::Vec3A;

/// Buffers that a thread reuses from band to band.
pub(crate) struct Buffers {
    /// For each lamp: points that it lights unless something is between.
    waiting: Vec<Vec<Waiting>>,
    directions: Vec<Vec3A>,
    candidates: BundleCandidates,
    stacks: Stacks,
}

/// A pixel of a band and the light that a lamp may add to it.
struct Waiting {
    pixel: usize,
    /// From the lamp to slightly above the surface.
    direction: Vec3A,
    light: Vec3A,
}

/// Surface points of eight pixels, by axis.
#[derive(Default)]
struct Points {
    position: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    albedo: [[f32; LANES]; 3],
    to_eye: [[f32; LANES]; 3],
    flat: [Vec3A; LANES],
    body: [u32; LANES],
}

/// A picture that is being shaded.
pub(crate) struct Shading<'a> {
    pub stage: &'a Stage,
    pub view: &'a View<'a>,
    pub visibility: &'a Visibility,
    pub shadows: bool,
}

impl Buffers {
    pub fn new() -> Self {
        Self {
            waiting: Vec::new(),
            directions: Vec::new(),
            candidates: BundleCandidates::default(),
            stacks: Stacks::new(),
        }
    }
}

impl Shading<'_> {
    /// Whether a lamp may cast a shadow that the eye sees.
    pub fn may_cast(&self) -> bool {
        let eye = self.view.origin;
        let least = self.visibility.depth.iter().copied().fold(f32::INFINITY, f32::min);
        // Rays are at least as long as their parameter says.
        self.stage.lamps().iter().any(|lamp| {
            let apart = lamp.centre().distance(eye);
            apart.is_nan() || apart >= BESIDE_EYE_SHARE * (least - apart).max(0.0)
        })
    }

    /// Shades the rows of a picture from row `first`.
    pub fn shade(&self, first: usize, rows: &mut Rows<'_>, buffers: &mut Buffers) {
        dispatch!(self.stage.level, simd => self.shade_in(simd, first, rows, buffers));
    }

    #[inline(always)]
    fn shade_in<S: Simd>(&self, simd: S, first: usize, rows: &mut Rows<'_>, buffers: &mut Buffers) {
        let width = self.view.rays.width();
        buffers.waiting.resize_with(self.stage.lamps().len(), Vec::new);
        let count = rows.depth.len() / width;
        let mut points = Points::default();
        let mut body = 0;
        let mut top = 0;
        while top < count {
            let mut left = 0;
            while left < width {
                let mut row = top;
                while row < count.min(top + TILE) {
                    self.pixels(simd, [left, first + row], row * width + left, rows, &mut points, &mut body, buffers);
                    row += 1;
                }
                if self.shadows {
                    self.cast(rows, buffers);
                }
                left += TILE;
            }
            top += TILE;
        }
    }

    /// Shades up to eight pixels of a row from pixel `u`, `v`; `to` is their place in `rows`.
    #[allow(clippy::too_many_arguments, reason = "one call")]
    #[inline(always)]
    fn pixels<S: Simd>(
        &self,
        simd: S,
        [u, v]: [usize; 2],
        to: usize,
        rows: &mut Rows<'_>,
        points: &mut Points,
        body: &mut usize,
        buffers: &mut Buffers,
    ) {
        let Self { stage, view, visibility, .. } = self;
        let at = v * view.rays.stride() + u;
        let count = LANES.min(view.rays.width() - u);
        let to_camera = view.rotation.transpose();
        let mut open = 0_u64;
        for lane in 0..count {
            let number = visibility.triangle[at + lane];
            if number == NOTHING {
                (rows.depth[to + lane], rows.labels[to + lane]) = (0.0, 0);
                rows.normals[to + lane] = [0.0; 3];
                let seen = view.rays.through(u + lane, v).x == view.rays.through(u + lane, v).x;
                rows.light[to + lane] = if seen { stage.environment } else { [0.0; 3] };
                continue;
            }
            *body = stage.body_of(number, *body);
            let ray = view.rays.through(u + lane, v);
            let direction = view.rotation * ray;
            let t = visibility.depth[at + lane];
            let surface = stage.surface_along(*body, number, view.origin, direction, t);
            let to_eye = -direction.normalize();
            for k in 0..3 {
                points.position[k][lane] = surface.position[k];
                points.normal[k][lane] = surface.smooth[k];
                points.albedo[k][lane] = surface.albedo[k];
                points.to_eye[k][lane] = to_eye[k];
            }
            points.flat[lane] = surface.flat;
            points.body[lane] = *body as u32;
            rows.depth[to + lane] = (t * ray.z).max(0.0);
            rows.labels[to + lane] = stage.label_of(*body);
            rows.normals[to + lane] = (to_camera * surface.smooth).to_array();
            open |= 1 << lane;
        }
        while open != 0 {
            let first = points.body[open.trailing_zeros() as usize & (LANES - 1)];
            let mut group = 0;
            for lane in 0..LANES {
                group |= u64::from(points.body[lane] == first) << lane;
            }
            group &= open;
            open &= !group;
            let light = self.light(simd, first as usize, group, to, points, buffers);
            for lane in 0..LANES {
                if group >> lane & 1 == 1 {
                    rows.light[to + lane] = [light[0][lane], light[1][lane], light[2][lane]];
                }
            }
        }
    }

    /// Light of the points in the lanes `group`, which are of one body. Light that may be blocked
    /// is left waiting.
    #[inline(always)]
    fn light<S: Simd>(
        &self,
        simd: S,
        body: usize,
        group: u64,
        to: usize,
        points: &Points,
        buffers: &mut Buffers,
    ) -> [[f32; LANES]; 3] {
        let material = self.stage.material_of(body);
        let position = load(simd, &points.position);
        let normal = load(simd, &points.normal);
        let albedo = load(simd, &points.albedo);
        let to_eye = load(simd, &points.to_eye);
        let zero = splat(simd, 0.0);
        // Metal mirrors the room: approximately darker towards grazing angles, where it mirrors
        // what lies behind it.
        let ambient = if material.is_metal() { dot(normal, to_eye) * 0.85 + 0.35 } else { splat(simd, 1.0) };
        let environment = self.stage.environment;
        let mut sum = [zero; 3];
        for k in 0..3 {
            sum[k] = albedo[k] * ambient * environment[k];
        }
        for (number, lamp) in self.stage.lamps().iter().enumerate() {
            let arriving = lamp.arriving_at(simd, &position);
            let back = material.lit(simd, &albedo, &normal, &to_eye, &arriving.direction);
            let mut added = [zero; 3];
            for k in 0..3 {
                added[k] = back[k] * arriving.light[k];
            }
            let mut added = only(simd, arriving.reached, added);
            if self.shadows {
                let apart = arriving.distance * BESIDE_EYE_SHARE;
                let beside = (apart * apart).simd_gt(splat(simd, lamp.centre().distance_squared(self.view.origin)));
                let lit = (added[0] + added[1] + added[2]).simd_gt(zero);
                let mut lanes = !beside.to_bitmask() & lit.to_bitmask() & group;
                let values: [[f32; LANES]; 3] = [added[0].into(), added[1].into(), added[2].into()];
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & (LANES - 1);
                    lanes &= lanes - 1;
                    let [x, y, z] = &points.position;
                    let position = Vec3A::new(x[lane], y[lane], z[lane]);
                    let flat = points.flat[lane];
                    let direction = position + flat * offset(position) - lamp.centre();
                    // A surface that faces away from the lamp is in its own shadow.
                    if direction.dot(flat) < 0.0 {
                        let light = Vec3A::new(values[0][lane], values[1][lane], values[2][lane]);
                        buffers.waiting[number].push(Waiting { pixel: to + lane, direction, light });
                    }
                }
                added = only(simd, beside, added);
            }
            for k in 0..3 {
                sum[k] += added[k];
            }
        }
        [sum[0].into(), sum[1].into(), sum[2].into()]
    }

    /// Adds the waiting light of a tile where no surface blocks it. Rays start at the lamp, so
    /// those of a tile form a bundle.
    fn cast(&self, rows: &mut Rows<'_>, buffers: &mut Buffers) {
        let Buffers { waiting, directions, candidates, stacks } = buffers;
        for (lamp, waiting) in self.stage.lamps().iter().zip(waiting) {
            if waiting.is_empty() {
                continue;
            }
            let centre = lamp.centre();
            directions.clear();
            directions.extend(waiting.iter().map(|w| w.direction));
            self.stage.collect_bundle(centre, directions, candidates);
            for Waiting { pixel, direction, light } in waiting.drain(..) {
                if !self.stage.bundle_blocked(candidates, centre, direction, SHADOW_RAY_END, stacks) {
                    let sum = Vec3A::from(rows.light[pixel]) + light;
                    rows.light[pixel] = sum.to_array();
                }
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, from: &[[f32; LANES]; 3]) -> Vec8<S> {
    [f32x8::from_slice(simd, &from[0]), f32x8::from_slice(simd, &from[1]), f32x8::from_slice(simd, &from[2])]
}
