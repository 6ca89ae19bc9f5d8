//! A fine surface carried by a coarse tetrahedral body.

use crate::{TetMesh, TetQuality, TriMesh};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Barycentric attachment of surface vertices to the elements that hold (or are nearest to) them.
#[derive(Clone, Debug)]
pub struct Skin {
    /// For each surface vertex: element and four weights that sum to 1.
    pub bindings: Vec<(u32, [f64; 4])>,
}

impl Skin {
    /// Binds each vertex of `surface` to `body` in the rest shape: to the element that holds it, or for a vertex outside the body to the
    /// element among the nearest that it is least outside of.
    pub fn bind(surface: &TriMesh, body: &TetMesh) -> Self {
        let buckets = Buckets::new(body);
        let bindings = surface.vertices.par_iter().map(|p| buckets.binding(body, *p)).collect();
        Self { bindings }
    }

    /// Surface vertex positions when the body's nodes are at `nodes` [m], written to `out`.
    pub fn deform(&self, body: &TetMesh, nodes: &[DVec3], out: &mut [DVec3]) {
        for (p, (t, weights)) in out.iter_mut().zip(&self.bindings) {
            *p = body.tets[*t as usize].iter().zip(weights).map(|(i, w)| nodes[*i as usize] * *w).sum();
        }
    }
}

/// Elements by the grid cells their bounding boxes touch, sorted by cell.
struct Buckets {
    origin: DVec3,
    cell: f64,
    dims: [i64; 3],
    tets: Vec<(i64, u32)>,
}

/// Cells searched around a vertex, at most; beyond, the nearest element by its middle is taken.
const RINGS: i64 = 4;

impl Buckets {
    fn new(body: &TetMesh) -> Self {
        let (lo, hi) = body.bounds().unwrap_or_default();
        let cell = (2.0 * TetQuality::of(body).median_edge).max(f64::MIN_POSITIVE);
        let dims = ((hi - lo) / cell).to_array().map(|n| n as i64 + 1);
        let mut buckets = Self { origin: lo, cell, dims, tets: Vec::new() };
        for t in 0..body.tets.len() {
            let x = body.corners(t);
            let low = buckets.cell_of(x.iter().copied().reduce(DVec3::min).unwrap_or_default());
            let high = buckets.cell_of(x.iter().copied().reduce(DVec3::max).unwrap_or_default());
            for k in low[2]..=high[2] {
                for j in low[1]..=high[1] {
                    for i in low[0]..=high[0] {
                        let number = buckets.number([i, j, k]);
                        buckets.tets.push((number, t as u32));
                    }
                }
            }
        }
        buckets.tets.sort_unstable();
        buckets
    }

    fn cell_of(&self, p: DVec3) -> [i64; 3] {
        let c = ((p - self.origin) / self.cell).floor();
        [0, 1, 2].map(|d| (c[d] as i64).clamp(0, self.dims[d] - 1))
    }

    fn number(&self, [i, j, k]: [i64; 3]) -> i64 {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    fn binding(&self, body: &TetMesh, p: DVec3) -> (u32, [f64; 4]) {
        let centre = self.cell_of(p);
        let mut best: Option<(f64, u32, [f64; 4])> = None;
        for ring in 0..=RINGS {
            let had_one = best.is_some();
            for k in centre[2] - ring..=centre[2] + ring {
                for j in centre[1] - ring..=centre[1] + ring {
                    for i in centre[0] - ring..=centre[0] + ring {
                        let c = [i, j, k];
                        let on_ring = (0..3).any(|d| (c[d] - centre[d]).abs() == ring);
                        if on_ring && (0..3).all(|d| (0..self.dims[d]).contains(&c[d])) {
                            self.search(body, p, self.number(c), &mut best);
                        }
                    }
                }
            }
            // An element that holds the point ends the search; one that does not asks for one ring more.
            if best.is_some_and(|b| b.0 >= 0.0) || had_one {
                break;
            }
        }
        let nearest_middle = || {
            let middle = |t: usize| body.corners(t).iter().sum::<DVec3>() / 4.0;
            let by_distance =
                |a: &usize, b: &usize| (middle(*a) - p).length_squared().total_cmp(&(middle(*b) - p).length_squared());
            (0..body.tets.len()).min_by(by_distance).unwrap_or(0) as u32
        };
        best.map_or_else(|| (nearest_middle(), [0.25; 4]), |(_, t, weights)| (t, weights))
    }

    fn search(&self, body: &TetMesh, p: DVec3, cell: i64, best: &mut Option<(f64, u32, [f64; 4])>) {
        let start = self.tets.partition_point(|b| b.0 < cell);
        for (_, t) in self.tets[start..].iter().take_while(|b| b.0 == cell) {
            let weights = barycentric(body.corners(*t as usize), p);
            let least = weights.into_iter().fold(f64::INFINITY, f64::min);
            if best.is_none_or(|b| least > b.0) {
                *best = Some((least, *t, weights));
            }
        }
    }
}

/// Barycentric weights of `p` in a tetrahedron.
fn barycentric([a, b, c, d]: [DVec3; 4], p: DVec3) -> [f64; 4] {
    let w = DMat3::from_cols(b - a, c - a, d - a).inverse() * (p - a);
    [1.0 - w.x - w.y - w.z, w.x, w.y, w.z]
}
