//! The dashpots along the edges of elements.
//!
//! An edge e of length l had the length l0 where the substep of h began. With a dashpot c, its
//! energy and its force are
//!
//! ```text
//! c (l^2 - l0^2)^2 / (8 h l0^2),    c (l^2 - l0^2) / (2 h l0^2) e.
//! ```
//!
//! All but l and e are constants of the substep.

use super::layout::{Batch, Layout, MIN_BATCHES};
use crate::Body;
use crate::inversion_guard::MIN_SQUARED_LENGTH;
use crate::lanes::{LANES, Row, Vec3L, dot, gather, load, splat, sub};
use crate::threads::in_parts;
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x16};
use std::collections::BTreeMap;

/// The edges of an element, by corners. Corner 0 is the origin of the edges.
pub(super) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// Dashpots of sixteen elements in a substep, edge by edge.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct BatchDashpots {
    /// c / (2 h l0^2) (N/m3).
    pub factor: [[f32; LANES]; 6],
    /// l0^2 (m2).
    pub squared_length: [[f32; LANES]; 6],
}

/// The dashpots of a body; there is none without viscosity.
pub(super) struct Dashpots {
    /// Each element's part of c (N s/m).
    parts: Vec<[[f32; LANES]; 6]>,
    /// The constants of the substep.
    pub batches: Vec<BatchDashpots>,
    /// Whether the constants are those of another beginning.
    stale: bool,
}

impl Dashpots {
    /// Divides the dashpot of an edge among its elements by their volume.
    pub fn new(layout: &Layout, body: &Body) -> Self {
        let parts = if body.material.viscosity > 0.0 { parts(layout, body) } else { Vec::new() };
        let zero = [[0.0; LANES]; 6];
        Self { batches: vec![BatchDashpots { factor: zero, squared_length: zero }; parts.len()], parts, stale: true }
    }

    /// The substep begins elsewhere than the last one.
    pub fn begin_elsewhere(&mut self) {
        self.stale = true;
    }

    /// Finds the constants of a substep of `h` (s) that begins with the nodes at `start`, if they
    /// are not known.
    pub fn refresh(&mut self, level: Level, layout: &Layout, start: &[Row], h: f32) {
        if !std::mem::take(&mut self.stale) {
            return;
        }
        let parts = &self.parts;
        in_parts(&mut self.batches, MIN_BATCHES, |first, batches| {
            let known = layout.batches[first..].iter().zip(&parts[first..]);
            dispatch!(level, simd => for (dashpots, (batch, parts)) in batches.iter_mut().zip(known) {
                let edges = edges(simd, batch, start);
                for k in 0..6 {
                    let before = edge(&edges, k);
                    let length = simd.max_f32x16(dot(before, before), splat(simd, MIN_SQUARED_LENGTH));
                    let factor = load(simd, &parts[k]) / (length * splat(simd, 2.0 * h));
                    factor.store_slice(&mut dashpots.factor[k]);
                    length.store_slice(&mut dashpots.squared_length[k]);
                }
            });
        });
    }
}

impl BatchDashpots {
    /// The force along an edge that is now `edge`, over its length (N/m).
    #[inline(always)]
    pub fn along<S: Simd>(&self, simd: S, k: usize, edge: Vec3L<S>) -> f32x16<S> {
        load(simd, &self.factor[k]) * (dot(edge, edge) - load(simd, &self.squared_length[k]))
    }
}

/// Edges of a batch's elements from corner 0.
#[inline(always)]
pub(super) fn edges<S: Simd>(simd: S, batch: &Batch, x: &[Row]) -> [Vec3L<S>; 3] {
    let origin = gather(simd, x, &batch.nodes[0]);
    [
        sub(gather(simd, x, &batch.nodes[1]), origin),
        sub(gather(simd, x, &batch.nodes[2]), origin),
        sub(gather(simd, x, &batch.nodes[3]), origin),
    ]
}

/// Edge number `k` of elements with these edges from corner 0.
#[inline(always)]
pub(super) fn edge<S: Simd>(edges: &[Vec3L<S>; 3], k: usize) -> Vec3L<S> {
    let [i, j] = EDGES[k];
    if i == 0 { edges[j - 1] } else { sub(edges[j - 1], edges[i - 1]) }
}

/// Each element's part of its edges' dashpots, by its share of the volume at the edge.
fn parts(layout: &Layout, body: &Body) -> Vec<[[f32; LANES]; 6]> {
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
