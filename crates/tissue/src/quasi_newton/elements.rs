//! Evaluation of a body's elements: forces on their corners, and volume ratios.

use super::iterate::Iterate;
use super::layout::{Batch, Layout};
use super::stress::{Stress, add_limit};
use crate::Body;
use crate::inversion_guard::{KEPT_SHARE, MIN_SQUARED_LENGTH, MIN_VOLUME_RATIO, is_squeezed};
use crate::lanes::{LANES, Mat3L, Row, Vec3L, add, apply, cross, dot, gather, load, scale, splat, store_rows, sub};
use crate::material::{MAX_FREE_STRETCH_SQUARED, StretchEnergy};
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x16};
use std::collections::BTreeMap;
use trocar_core::has_threads;

/// Fewest batches that are worth a thread of their own.
const MIN_BATCHES: usize = 600;

/// Forces and volume ratios of the elements.
pub(super) struct Elements {
    pub stress: Stress,
    /// What limits large stretches.
    pub limit: Option<StretchEnergy>,
    /// Gradient of the energy by each corner's position (N), batch by batch, corner by corner.
    pub corners: Vec<Row>,
    /// Volume ratios at the accepted positions, and at those of the last evaluation.
    pub ratios: Vec<[f32; LANES]>,
    pub trial: Vec<[f32; LANES]>,
    /// Whether an element may have been stretched beyond the limit in an evaluation since the
    /// stiffened elements were last sought in vain.
    pub stretched: bool,
    /// Each element's part of the dashpots along its edges (N s/m); empty without viscosity.
    dashpots: Vec<[[f32; LANES]; 6]>,
    /// Whether the last evaluation was of a body at rest, by `evaluate_in_place`.
    pub in_place: bool,
}

impl Elements {
    pub fn new(layout: &Layout, body: &Body) -> Self {
        let batches = layout.batches.len();
        Self {
            stress: Stress::of(&body.material),
            limit: body.material.stretch_energy(),
            corners: vec![[0.0; 4]; batches * 4 * LANES],
            ratios: vec![[1.0; LANES]; batches],
            trial: vec![[1.0; LANES]; batches],
            stretched: false,
            dashpots: if body.material.viscosity > 0.0 { dashpots(layout, body) } else { Vec::new() },
            in_place: false,
        }
    }

    /// Evaluates forces and volume ratios where the nodes are, in a substep of `h` (s). Returns
    /// whether an element has lost too much of its accepted volume.
    pub fn evaluate(&mut self, level: Level, layout: &Layout, at: &Iterate, h: f32) -> bool {
        self.in_place = false;
        let Self { stress, limit, corners, ratios, trial, dashpots, .. } = self;
        let kernel = Kernel { level, stress, limit: limit.as_ref(), at, h };
        let found = kernel.evaluate(Block { batches: &layout.batches, ratios, dashpots, trial, corners });
        self.stretched |= found.stretched;
        found.squeezed
    }

    /// Accepts the positions of the last evaluation.
    pub fn accept(&mut self) {
        std::mem::swap(&mut self.ratios, &mut self.trial);
    }

    /// Calls `found` with the nodes of every element that is squeezed too far at the last
    /// evaluation.
    pub fn for_squeezed(&self, layout: &Layout, mut found: impl FnMut([u32; 4])) {
        for (b, batch) in layout.batches.iter().enumerate() {
            for lane in 0..LANES {
                if is_squeezed(self.trial[b][lane], self.ratios[b][lane]) {
                    found(batch.nodes.map(|nodes| nodes[lane]));
                }
            }
        }
    }
}

/// Elements with what is known and found of them, batch by batch.
struct Block<'a> {
    batches: &'a [Batch],
    ratios: &'a [[f32; LANES]],
    /// Empty without viscosity.
    dashpots: &'a [[[f32; LANES]; 6]],
    trial: &'a mut [[f32; LANES]],
    corners: &'a mut [Row],
}

impl Block<'_> {
    /// The batches before the one of number `at`, and the others.
    fn split(self, at: usize) -> (Self, Self) {
        let (batches, other_batches) = self.batches.split_at(at);
        let (ratios, other_ratios) = self.ratios.split_at(at);
        let (dashpots, other_dashpots) = self.dashpots.split_at(at.min(self.dashpots.len()));
        let (trial, other_trial) = self.trial.split_at_mut(at);
        let (corners, other_corners) = self.corners.split_at_mut(at * 4 * LANES);
        (
            Self { batches, ratios, dashpots, trial, corners },
            Self {
                batches: other_batches,
                ratios: other_ratios,
                dashpots: other_dashpots,
                trial: other_trial,
                corners: other_corners,
            },
        )
    }
}

/// What an evaluation finds.
#[derive(Clone, Copy)]
struct Found {
    /// Whether an element has lost too much of its accepted volume.
    squeezed: bool,
    /// Whether one may be stretched beyond the limit.
    stretched: bool,
}

/// The evaluation of elements where the nodes are.
struct Kernel<'a> {
    level: Level,
    stress: &'a Stress,
    limit: Option<&'a StretchEnergy>,
    at: &'a Iterate,
    h: f32,
}

impl Kernel<'_> {
    /// Evaluates a block, a large one in halves at once.
    fn evaluate(&self, block: Block<'_>) -> Found {
        let count = block.batches.len();
        if count >= 2 * MIN_BATCHES && has_threads() {
            let (first, second) = block.split(count / 2);
            let (a, b) = rayon::join(|| self.evaluate(first), || self.evaluate(second));
            return Found { squeezed: a.squeezed || b.squeezed, stretched: a.stretched || b.stretched };
        }
        dispatch!(self.level, simd => if block.dashpots.is_empty() {
            self.evaluate_with::<_, false>(simd, block)
        } else {
            self.evaluate_with::<_, true>(simd, block)
        })
    }

    /// The kernel. The dashpots need where the substep began.
    #[inline(always)]
    fn evaluate_with<S: Simd, const VISCOUS: bool>(&self, simd: S, block: Block<'_>) -> Found {
        let Block { batches, ratios, dashpots, trial, corners } = block;
        let Iterate { x, start, .. } = self.at;
        let (zero, rate) = (splat(simd, 0.0), splat(simd, 1.0 / self.h));
        let (mut squeezed, mut stretched) = (zero, false);
        for (b, batch) in batches.iter().enumerate() {
            let edges = edges(simd, batch, x);
            let f = deformation(simd, batch, &edges);
            let ratio = dot(f[0], cross(f[1], f[2]));
            ratio.store_slice(&mut trial[b]);
            squeezed = simd.max_f32x16(squeezed, lack(simd, ratio, load(simd, &ratios[b])));
            let mut p = self.stress.at(simd, &f, ratio);
            let square = dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
            if simd.any_true_mask32x16(simd.simd_gt_f32x16(square, splat(simd, MAX_FREE_STRETCH_SQUARED as f32)))
                && let Some(limit) = self.limit
            {
                stretched = true;
                add_limit(simd, limit, &f, &mut p);
            }
            let volume = load(simd, &batch.volumes);
            for c in 0..3 {
                p[c] = scale(p[c], volume);
            }
            let mut forces = [
                apply(&p, gradient(simd, batch, 0)),
                apply(&p, gradient(simd, batch, 1)),
                apply(&p, gradient(simd, batch, 2)),
            ];
            let mut first = sub([zero; 3], add(add(forces[0], forces[1]), forces[2]));
            if VISCOUS {
                let from = self::edges(simd, batch, start);
                for (k, [i, j]) in EDGES.into_iter().enumerate() {
                    // Corner 0 is the origin of the edges.
                    let (before, now) = if i == 0 {
                        (from[j - 1], edges[j - 1])
                    } else {
                        (sub(from[j - 1], from[i - 1]), sub(edges[j - 1], edges[i - 1]))
                    };
                    let length = simd.max_f32x16(dot(before, before), splat(simd, MIN_SQUARED_LENGTH));
                    let along = load(simd, &dashpots[b][k]) * rate * (dot(now, now) - length) / (length + length);
                    let force = scale(now, along);
                    forces[j - 1] = add(forces[j - 1], force);
                    if i == 0 {
                        first = sub(first, force);
                    } else {
                        forces[i - 1] = sub(forces[i - 1], force);
                    }
                }
            }
            let rows = &mut corners[b * 4 * LANES..(b + 1) * 4 * LANES];
            store_rows(simd, first, &mut rows[..LANES]);
            store_rows(simd, forces[0], &mut rows[LANES..2 * LANES]);
            store_rows(simd, forces[1], &mut rows[2 * LANES..3 * LANES]);
            store_rows(simd, forces[2], &mut rows[3 * LANES..]);
        }
        Found { squeezed: simd.any_true_mask32x16(simd.simd_gt_f32x16(squeezed, zero)), stretched }
    }
}

/// Shortfall of a volume ratio below its minimum after the ratio `before`; 0 if there is none. NaN
/// counts as too low.
#[inline(always)]
fn lack<S: Simd>(simd: S, ratio: f32x16<S>, before: f32x16<S>) -> f32x16<S> {
    let floor = simd.min_f32x16(simd.max_f32x16(before * KEPT_SHARE, splat(simd, MIN_VOLUME_RATIO)), before);
    simd.select_f32x16(simd.simd_ge_f32x16(ratio, floor), splat(simd, 0.0), splat(simd, 1.0))
}

/// The edges of an element, by corners.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Each element's part of its edges' dashpots, by its share of the volume at the edge.
fn dashpots(layout: &Layout, body: &Body) -> Vec<[[f32; LANES]; 6]> {
    let vertices = |batch: &Batch, lane: usize, [i, j]: [usize; 2]| {
        let (i, j) = (layout.vertex[batch.nodes[i][lane] as usize], layout.vertex[batch.nodes[j][lane] as usize]);
        (i.min(j), i.max(j))
    };
    let mut volumes = BTreeMap::new();
    for batch in &layout.batches {
        for lane in 0..LANES {
            for edge in EDGES {
                *volumes.entry(vertices(batch, lane, edge)).or_insert(0.0) += batch.volumes[lane];
            }
        }
    }
    let part = |batch: &Batch, lane: usize, edge: [usize; 2]| {
        let (i, j) = vertices(batch, lane, edge);
        let whole = body.edges_of(i as usize).iter().find(|e| e.to == j).map_or(0.0, |e| e.damping);
        whole * batch.volumes[lane] / volumes.get(&(i, j)).copied().unwrap_or(1.0)
    };
    let of = |batch: &Batch| EDGES.map(|edge| std::array::from_fn(|lane| part(batch, lane, edge)));
    layout.batches.iter().map(of).collect()
}

/// Edges of a batch's elements from corner 0.
#[inline(always)]
fn edges<S: Simd>(simd: S, batch: &Batch, x: &[Row]) -> [Vec3L<S>; 3] {
    let origin = gather(simd, x, &batch.nodes[0]);
    [
        sub(gather(simd, x, &batch.nodes[1]), origin),
        sub(gather(simd, x, &batch.nodes[2]), origin),
        sub(gather(simd, x, &batch.nodes[3]), origin),
    ]
}

/// Deformation gradients of a batch.
#[inline(always)]
fn deformation<S: Simd>(simd: S, batch: &Batch, edges: &[Vec3L<S>; 3]) -> Mat3L<S> {
    let m = [gradient(simd, batch, 0), gradient(simd, batch, 1), gradient(simd, batch, 2)];
    let mut f = *edges;
    for c in 0..3 {
        f[c] = add(add(scale(edges[0], m[0][c]), scale(edges[1], m[1][c])), scale(edges[2], m[2][c]));
    }
    f
}

/// Rest gradient of corner k + 1.
#[inline(always)]
fn gradient<S: Simd>(simd: S, batch: &Batch, k: usize) -> Vec3L<S> {
    let m = &batch.gradients[k];
    [load(simd, &m[0]), load(simd, &m[1]), load(simd, &m[2])]
}
