//! Direct light on what was rasterised: eight pixels of a body at a time.

use crate::antialias::Marks;
use crate::background::Behind;
use crate::bvh::Stacks;
use crate::direct::{BESIDE_EYE_SHARE, SHADOW_RAY_END};
use crate::lanes::{LANES, Vec8, dot, splat};
use crate::material::only;
use crate::picture::Rows;
use crate::raster::{NOTHING, Seen, View};
use crate::rays::TILE;
use crate::shading_frame::offset;
use crate::stage::{BundleCandidates, Stage, Surfaces, turned};
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x8, u32x8};
use glam::Vec3A;
use std::ops::Range;

/// Buffers that a thread reuses from band to band.
pub(crate) struct Buffers {
    /// For each lamp: points that it lights unless something is between.
    waiting: Vec<Vec<Waiting>>,
    directions: Vec<Vec3A>,
    candidates: BundleCandidates,
    stacks: Stacks,
    /// Which parts of [`LANES`] pixels of the rows were shaded.
    pub shaded: Vec<bool>,
}

/// A pixel of a band and the light that a lamp may add to it.
struct Waiting {
    pixel: usize,
    /// From the lamp to slightly above the surface.
    direction: Vec3A,
    light: Vec3A,
}

/// Eight pixels of a row.
#[derive(Clone, Copy)]
struct Part {
    /// Place of the first in the rows that are seen.
    at: usize,
    /// Place of its ray.
    ray: usize,
    /// Place of its colour.
    to: usize,
}

/// A picture that is being shaded.
#[derive(Clone, Copy)]
pub(crate) struct Shading<'a> {
    pub stage: &'a Stage,
    pub view: &'a View<'a>,
    pub shadows: bool,
    /// What the rows hold already.
    pub behind: Option<Behind<'a>>,
    /// By body, which cast shadows.
    pub casting: &'a (dyn Fn(usize) -> bool + Sync),
    /// The pixels to shade; `None` for all.
    pub marks: Option<&'a Marks>,
}

impl Buffers {
    pub fn new() -> Self {
        Self {
            waiting: Vec::new(),
            directions: Vec::new(),
            candidates: BundleCandidates::default(),
            stacks: Stacks::new(),
            shaded: Vec::new(),
        }
    }

    pub fn candidates(&mut self) -> &mut BundleCandidates {
        &mut self.candidates
    }
}

/// Whether a lamp of the stage may cast a shadow that an eye at `eye` sees on what is at least
/// `least` away from it (m).
pub(crate) fn may_cast(stage: &Stage, eye: Vec3A, least: f32) -> bool {
    stage.lamps().iter().any(|lamp| {
        let apart = lamp.centre().distance(eye);
        apart.is_nan() || apart >= BESIDE_EYE_SHARE * (least - apart).max(0.0)
    })
}

impl<'a> Shading<'a> {
    /// Of all pixels, without shadows.
    pub fn new(stage: &'a Stage, view: &'a View<'a>) -> Self {
        Self { stage, view, shadows: false, behind: None, casting: &|_| true, marks: None }
    }

    /// Shades the rows of a picture from row `first`.
    pub fn shade(&self, first: usize, seen: &Seen<'_>, rows: &mut Rows<'_>, buffers: &mut Buffers) {
        dispatch!(self.stage.level, simd => self.shade_in(simd, first, seen, rows, buffers));
    }

    #[inline(always)]
    fn shade_in<S: Simd>(&self, simd: S, first: usize, seen: &Seen<'_>, rows: &mut Rows<'_>, buffers: &mut Buffers) {
        let (width, stride) = (self.view.rays.width(), self.view.rays.stride());
        buffers.waiting.resize_with(self.stage.lamps().len(), Vec::new);
        let count = rows.depth.len() / width;
        let parts = width.div_ceil(LANES);
        buffers.shaded.clear();
        buffers.shaded.resize(count * parts, false);
        let (tiles, mut body) = (width.div_ceil(TILE), (0, 0..0));
        let mut top = 0;
        while top < count {
            let mut left = 0;
            while left < width {
                let shaded_anew = self.shaded_anew((first + top) / TILE * tiles + left / TILE, buffers);
                let mut row = top;
                while row < count.min(top + TILE) {
                    let part =
                        Part { at: row * stride + left, ray: (first + row) * stride + left, to: row * width + left };
                    let within = (1 << LANES.min(width - left)) - 1;
                    let wanted = self.marks.map_or(within, |marks| marks.at(first + row, left) & within);
                    let fresh = if shaded_anew { wanted } else { self.fresh(simd, part, wanted, seen) };
                    if fresh != 0 {
                        buffers.shaded[row * parts + left / LANES] = true;
                        self.pixels(simd, fresh, part, seen, rows, &mut body, buffers);
                    }
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

    /// Whether shadows in a tile may differ from those behind.
    fn shaded_anew(&self, tile: usize, buffers: &mut Buffers) -> bool {
        let Some(behind) = self.behind.filter(|_| self.shadows) else { return false };
        let shown = behind.boxes.get(tile).copied().flatten();
        self.stage.shaded_anew(shown, |body| !behind.shows(body), &mut buffers.candidates)
    }

    /// Which of the `wanted` pixels of a part are not as those behind.
    #[inline(always)]
    fn fresh<S: Simd>(&self, simd: S, Part { at, ray, .. }: Part, wanted: u64, seen: &Seen<'_>) -> u64 {
        let Some(Behind { visibility: behind, .. }) = self.behind else { return wanted };
        let now = u32x8::from_slice(simd, &seen.triangle[at..at + LANES]);
        let before = u32x8::from_slice(simd, &behind.triangle[ray..ray + LANES]);
        !now.simd_eq(before).to_bitmask() & wanted
    }

    /// Shades the pixels `fresh` of a part.
    #[allow(clippy::too_many_arguments, reason = "one call")]
    #[inline(always)]
    fn pixels<S: Simd>(
        &self,
        simd: S,
        fresh: u64,
        Part { at, ray: from, to }: Part,
        seen: &Seen<'_>,
        rows: &mut Rows<'_>,
        body: &mut (usize, Range<u32>),
        buffers: &mut Buffers,
    ) {
        let Self { stage, view, .. } = self;
        let numbers = &seen.triangle[at..at + LANES];
        let [x, y, z] = view.rays.axes();
        let mut bodies = [0; LANES];
        let mut open = 0_u64;
        for lane in 0..LANES {
            if fresh >> lane & 1 == 0 {
                continue;
            }
            if numbers[lane] != NOTHING {
                if !body.1.contains(&numbers[lane]) {
                    *body = stage.body_of(numbers[lane]);
                }
                bodies[lane] = body.0;
                open |= 1 << lane;
                continue;
            }
            (rows.depth[to + lane], rows.labels[to + lane]) = (0.0, 0);
            rows.normals[to + lane] = [0.0; 3];
            rows.light[to + lane] = if x[from + lane].is_nan() { [0.0; 3] } else { stage.environment };
        }
        if open == 0 {
            return;
        }
        let ray = [
            f32x8::from_slice(simd, &x[from..from + LANES]),
            f32x8::from_slice(simd, &y[from..from + LANES]),
            f32x8::from_slice(simd, &z[from..from + LANES]),
        ];
        let t = f32x8::from_slice(simd, &seen.depth[at..at + LANES]);
        let depth: [f32; LANES] = (t * ray[2]).max(splat(simd, 0.0)).into();
        let to_camera = view.rotation.transpose();
        while open != 0 {
            let body = bodies[open.trailing_zeros() as usize & (LANES - 1)];
            let mut group = 0;
            for lane in 0..LANES {
                group |= u64::from(bodies[lane] == body) << lane;
            }
            group &= open;
            open &= !group;
            let surfaces = stage.surfaces(simd, body, numbers, group, view, &ray, t);
            let [x, y, z] = self.light(simd, body, group, to, &surfaces, buffers);
            let normal = turned(&to_camera, &surfaces.smooth);
            let [a, b, c]: [[f32; LANES]; 3] = [normal[0].into(), normal[1].into(), normal[2].into()];
            let label = stage.label_of(body);
            while group != 0 {
                let lane = group.trailing_zeros() as usize & (LANES - 1);
                group &= group - 1;
                rows.light[to + lane] = [x[lane], y[lane], z[lane]];
                rows.normals[to + lane] = [a[lane], b[lane], c[lane]];
                (rows.depth[to + lane], rows.labels[to + lane]) = (depth[lane], label);
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
        points: &Surfaces<S>,
        buffers: &mut Buffers,
    ) -> [[f32; LANES]; 3] {
        let material = self.stage.material_of(body);
        let Surfaces { position, smooth: normal, albedo, to_eye, .. } = points;
        let zero = splat(simd, 0.0);
        // Metal mirrors the room: approximately darker towards grazing angles, where it mirrors
        // what lies behind it.
        let ambient = if material.is_metal() { dot(*normal, *to_eye) * 0.85 + 0.35 } else { splat(simd, 1.0) };
        let environment = self.stage.environment;
        let mut sum = [zero; 3];
        for k in 0..3 {
            sum[k] = albedo[k] * ambient * environment[k];
        }
        for (number, lamp) in self.stage.lamps().iter().enumerate() {
            let arriving = lamp.arriving_at(simd, position);
            let back = material.lit(simd, albedo, normal, to_eye, &arriving.direction);
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
                let values = lanes_of(&added);
                let (positions, flats) = (lanes_of(position), lanes_of(&points.flat));
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize & (LANES - 1);
                    lanes &= lanes - 1;
                    let position = one(&positions, lane);
                    let flat = one(&flats, lane);
                    let direction = position + flat * offset(position) - lamp.centre();
                    // A surface that faces away from the lamp is in its own shadow.
                    if direction.dot(flat) < 0.0 {
                        let light = one(&values, lane);
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
        let Buffers { waiting, directions, candidates, stacks, .. } = buffers;
        for (lamp, waiting) in self.stage.lamps().iter().zip(waiting) {
            if waiting.is_empty() {
                continue;
            }
            let centre = lamp.centre();
            directions.clear();
            directions.extend(waiting.iter().map(|w| w.direction));
            self.stage.collect_bundle(centre, directions, candidates);
            Stage::retain(candidates, self.casting);
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
fn lanes_of<S: Simd>(v: &Vec8<S>) -> [[f32; LANES]; 3] {
    [v[0].into(), v[1].into(), v[2].into()]
}

#[inline(always)]
fn one(v: &[[f32; LANES]; 3], lane: usize) -> Vec3A {
    Vec3A::new(v[0][lane], v[1][lane], v[2][lane])
}
