//! Evaluation of a body's elements: forces on their corners, and volume ratios.

use super::dashpots::{BatchDashpots, Dashpots, EDGES, edge, edges};
use super::iterate::Iterate;
use super::layout::{Batch, Layout, MIN_BATCHES};
use super::stress::{Stress, add_limit};
use crate::Body;
use crate::inversion_guard::{KEPT_SHARE, MIN_VOLUME_RATIO, is_squeezed};
use crate::lanes::{LANES, Mat3L, Row, Vec3L, add, apply, cross, dot, load, scale, splat, store_rows, sub};
use crate::material::{MAX_FREE_STRETCH_SQUARED, StretchEnergy};
use crate::threads::join;
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x16};
use trocar_core::has_threads;

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
    /// Elements that are stretched beyond the limit at the last evaluation, a bit for each lane of
    /// a batch; and whether there is any.
    pub beyond: Vec<u16>,
    pub stretched: bool,
    /// The dashpots along their edges.
    pub dashpots: Dashpots,
    /// Whether the last evaluation was of a body at rest, by `evaluate_in_place`.
    pub in_place: bool,
    /// Whether the volumes that were accepted last are those where a frame begins.
    pub is_accepted_here: bool,
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
            beyond: vec![0; batches],
            stretched: false,
            dashpots: Dashpots::new(layout, body),
            in_place: false,
            is_accepted_here: false,
        }
    }

    /// Evaluates forces and volume ratios where the nodes are, in a substep of `h` (s). Returns
    /// whether an element has lost too much of its accepted volume.
    pub fn evaluate(&mut self, level: Level, layout: &Layout, at: &Iterate, h: f32) -> bool {
        self.in_place = false;
        let Self { stress, limit, corners, ratios, trial, beyond, dashpots, .. } = self;
        dashpots.refresh(level, layout, &at.start, h);
        let kernel = Kernel { level, stress, limit: limit.as_ref(), x: &at.x };
        let dashpots = &dashpots.batches;
        let found = kernel.evaluate(Block { batches: &layout.batches, ratios, dashpots, trial, beyond, corners });
        self.stretched = found.stretched;
        found.squeezed
    }

    /// Accepts the positions of the last evaluation.
    pub fn accept(&mut self) {
        self.is_accepted_here = true;
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
    dashpots: &'a [BatchDashpots],
    trial: &'a mut [[f32; LANES]],
    beyond: &'a mut [u16],
    corners: &'a mut [Row],
}

impl Block<'_> {
    /// The batches before the one of number `at`, and the others.
    fn split(self, at: usize) -> (Self, Self) {
        let (batches, other_batches) = self.batches.split_at(at);
        let (ratios, other_ratios) = self.ratios.split_at(at);
        let (dashpots, other_dashpots) = self.dashpots.split_at(at.min(self.dashpots.len()));
        let (trial, other_trial) = self.trial.split_at_mut(at);
        let (beyond, other_beyond) = self.beyond.split_at_mut(at);
        let (corners, other_corners) = self.corners.split_at_mut(at * 4 * LANES);
        (
            Self { batches, ratios, dashpots, trial, beyond, corners },
            Self {
                batches: other_batches,
                ratios: other_ratios,
                dashpots: other_dashpots,
                trial: other_trial,
                beyond: other_beyond,
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
    /// Whether one is stretched beyond the limit.
    stretched: bool,
}

/// The evaluation of elements where the nodes are.
struct Kernel<'a> {
    level: Level,
    stress: &'a Stress,
    limit: Option<&'a StretchEnergy>,
    x: &'a [Row],
}

impl Kernel<'_> {
    /// Evaluates a block, a large one in halves at once.
    fn evaluate(&self, block: Block<'_>) -> Found {
        let count = block.batches.len();
        if count >= 2 * MIN_BATCHES && has_threads() {
            let (first, second) = block.split(count / 2);
            let (a, b) = join(|| self.evaluate(first), || self.evaluate(second));
            return Found { squeezed: a.squeezed || b.squeezed, stretched: a.stretched || b.stretched };
        }
        dispatch!(self.level, simd => if block.dashpots.is_empty() {
            self.evaluate_with::<_, false>(simd, block)
        } else {
            self.evaluate_with::<_, true>(simd, block)
        })
    }

    /// The kernel.
    #[inline(always)]
    fn evaluate_with<S: Simd, const VISCOUS: bool>(&self, simd: S, block: Block<'_>) -> Found {
        let Block { batches, ratios, dashpots, trial, beyond, corners } = block;
        let zero = splat(simd, 0.0);
        let (mut squeezed, mut stretched) = (zero, false);
        for (b, batch) in batches.iter().enumerate() {
            let edges = edges(simd, batch, self.x);
            let f = deformation(simd, batch, &edges);
            let ratio = dot(f[0], cross(f[1], f[2]));
            ratio.store_slice(&mut trial[b]);
            squeezed = simd.max_f32x16(squeezed, lack(simd, ratio, load(simd, &ratios[b])));
            let mut p = self.stress.at(simd, &f, ratio);
            beyond[b] = 0;
            let square = dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
            if simd.any_true_mask32x16(simd.simd_gt_f32x16(square, splat(simd, MAX_FREE_STRETCH_SQUARED as f32)))
                && let Some(limit) = self.limit
            {
                beyond[b] = add_limit(simd, limit, &f, &mut p);
                stretched |= beyond[b] != 0;
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
                for (k, [i, j]) in EDGES.into_iter().enumerate() {
                    let now = edge(&edges, k);
                    let force = scale(now, dashpots[b].along(simd, k, now));
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
