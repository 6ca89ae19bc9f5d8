//! One pass over a body's elements: forces on their corners and volume ratios.

use super::layout::{Batch, Layout};
use super::stress::{Stress, green_strain, times_symmetric};
use crate::lanes::{LANES, Mat3L, Row, Vec3L, add, apply, cross, dot, gather, load, scale, splat, store_rows, sub};
use crate::sweep::{FLOOR, KEPT_SHARE};
use fearless_simd::{Simd, SimdBase, f32x16};

/// What a pass over the elements writes, and what it compares with.
pub(super) struct Elements {
    stress: Stress,
    /// Twice the viscosity [Pa s].
    viscosity: f32,
    /// Gradient of the energy by each corner's position [N], batch by batch, corner by corner.
    pub corners: Vec<Row>,
    /// Volume ratios at the accepted positions and at those of the last pass.
    pub ratios: Vec<[f32; LANES]>,
    pub trial: Vec<[f32; LANES]>,
    /// Green's strains at the substep's beginning; empty without viscosity.
    start: Vec<[[f32; LANES]; 6]>,
}

impl Elements {
    pub fn new(layout: &Layout, stress: Stress, viscosity: f64) -> Self {
        let batches = layout.batches.len();
        Self {
            stress,
            viscosity: 2.0 * viscosity as f32,
            corners: vec![[0.0; 4]; batches * 4 * LANES],
            ratios: vec![[1.0; LANES]; batches],
            trial: vec![[1.0; LANES]; batches],
            start: vec![[[0.0; LANES]; 6]; if viscosity > 0.0 { batches } else { 0 }],
        }
    }

    /// Remembers the strains at `x`, from which viscosity counts; `x` are the positions of the accepted ratios.
    #[inline(always)]
    pub fn begin<S: Simd>(&mut self, simd: S, layout: &Layout, x: &[Row]) {
        for (batch, start) in layout.batches.iter().zip(&mut self.start) {
            let strain = green_strain(simd, &deformation(simd, batch, x));
            for (to, from) in start.iter_mut().zip(strain) {
                from.store_slice(to);
            }
        }
    }

    /// Forces and volume ratios at `x`; `h` is the substep [s]. Whether an element has lost too much of its accepted volume.
    #[inline(always)]
    pub fn pass<S: Simd>(&mut self, simd: S, layout: &Layout, x: &[Row], h: f32) -> bool {
        if self.start.is_empty() {
            self.pass_with::<S, false>(simd, layout, x, h)
        } else {
            self.pass_with::<S, true>(simd, layout, x, h)
        }
    }

    #[inline(always)]
    fn pass_with<S: Simd, const VISCOUS: bool>(&mut self, simd: S, layout: &Layout, x: &[Row], h: f32) -> bool {
        let mut squeezed = splat(simd, 0.0);
        let rate = splat(simd, self.viscosity / h);
        for (b, batch) in layout.batches.iter().enumerate() {
            let f = deformation(simd, batch, x);
            let ratio = dot(f[0], cross(f[1], f[2]));
            let mut p = self.stress.at(simd, &f, ratio);
            if VISCOUS {
                let (strain, start) = (green_strain(simd, &f), &self.start[b]);
                let mut s = strain;
                for k in 0..6 {
                    s[k] = (strain[k] - load(simd, &start[k])) * rate;
                }
                let viscous = times_symmetric(&f, s);
                for c in 0..3 {
                    p[c] = add(p[c], viscous[c]);
                }
            }
            ratio.store_slice(&mut self.trial[b]);
            squeezed = simd.max_f32x16(squeezed, lack(simd, ratio, load(simd, &self.ratios[b])));
            let volume = load(simd, &batch.volumes);
            for c in 0..3 {
                p[c] = scale(p[c], volume);
            }
            let forces = [
                apply(&p, gradient(simd, batch, 0)),
                apply(&p, gradient(simd, batch, 1)),
                apply(&p, gradient(simd, batch, 2)),
            ];
            let sum = add(add(forces[0], forces[1]), forces[2]);
            let zero = splat(simd, 0.0);
            let rows = &mut self.corners[b * 4 * LANES..(b + 1) * 4 * LANES];
            store_rows(simd, sub([zero, zero, zero], sum), &mut rows[..LANES]);
            store_rows(simd, forces[0], &mut rows[LANES..2 * LANES]);
            store_rows(simd, forces[1], &mut rows[2 * LANES..3 * LANES]);
            store_rows(simd, forces[2], &mut rows[3 * LANES..]);
        }
        simd.any_true_mask32x16(simd.simd_gt_f32x16(squeezed, splat(simd, 0.0)))
    }

    /// The last pass's positions are accepted.
    pub fn accept(&mut self) {
        std::mem::swap(&mut self.ratios, &mut self.trial);
    }

    /// Calls `found` with the nodes of every element that the last pass squeezed too far.
    pub fn for_squeezed(&self, layout: &Layout, mut found: impl FnMut([u32; 4])) {
        for (b, batch) in layout.batches.iter().enumerate() {
            for lane in 0..LANES {
                if crate::sweep::is_squeezed(self.trial[b][lane], self.ratios[b][lane]) {
                    found(batch.nodes.map(|nodes| nodes[lane]));
                }
            }
        }
    }

    /// Smallest accepted volume ratio.
    pub fn least_ratio(&self) -> f32 {
        self.ratios.iter().flatten().copied().fold(f32::INFINITY, f32::min)
    }
}

/// By how much a volume ratio is below what it must be after `before`; 0 or less where it is not. Not a number counts as too low.
#[inline(always)]
fn lack<S: Simd>(simd: S, ratio: f32x16<S>, before: f32x16<S>) -> f32x16<S> {
    let floor = simd.min_f32x16(simd.max_f32x16(before * KEPT_SHARE, splat(simd, FLOOR)), before);
    simd.select_f32x16(simd.simd_ge_f32x16(ratio, floor), splat(simd, 0.0), splat(simd, 1.0))
}

/// Deformation gradients of a batch.
#[inline(always)]
fn deformation<S: Simd>(simd: S, batch: &Batch, x: &[Row]) -> Mat3L<S> {
    let origin = gather(simd, x, &batch.nodes[0]);
    let edges = [
        sub(gather(simd, x, &batch.nodes[1]), origin),
        sub(gather(simd, x, &batch.nodes[2]), origin),
        sub(gather(simd, x, &batch.nodes[3]), origin),
    ];
    let m = [gradient(simd, batch, 0), gradient(simd, batch, 1), gradient(simd, batch, 2)];
    let mut f = edges;
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
