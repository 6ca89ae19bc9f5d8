//! The boundary of a body in double precision, by plain search over all of it.

use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use trocar_tissue::Body;

/// An edge and its triangles.
pub type Edge = ([usize; 2], Vec<[usize; 3]>);

/// The boundary of a body.
pub struct Surface {
    /// Its nodes, ascending.
    pub nodes: Vec<usize>,
    /// Counterclockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
    /// Edges, smaller node first, with their triangles.
    pub edges: Vec<Edge>,
}

impl Surface {
    /// The boundary of `body`, whose nodes are numbered from `first`.
    pub fn of(body: &Body, first: usize) -> Self {
        let (boundary, named) = body.rest().boundary();
        let node = |i: u32| first + named[i as usize] as usize;
        let triangles: Vec<[usize; 3]> = boundary.triangles.iter().map(|t| t.map(node)).collect();
        let mut nodes: Vec<usize> = triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut edges: BTreeMap<[usize; 2], Vec<[usize; 3]>> = BTreeMap::new();
        for t in &triangles {
            for (i, j) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                edges.entry([i.min(j), i.max(j)]).or_default().push(*t);
            }
        }
        Self { nodes, triangles, edges: edges.into_iter().collect() }
    }

    /// Whether `p` is inside: the triangles wind around it (van Oosterom and Strackee 1983, "The
    /// solid angle of a plane triangle").
    pub fn surrounds(&self, x: &[DVec3], p: DVec3) -> bool {
        let angle = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| x[i] - p);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            2.0 * libm::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
        };
        self.triangles.iter().map(angle).sum::<f64>() > TAU
    }

    /// Lowest and highest corner of a box around it.
    pub fn bounds(&self, x: &[DVec3]) -> (DVec3, DVec3) {
        let grow = |(low, high): (DVec3, DVec3), i: &usize| (low.min(x[*i]), high.max(x[*i]));
        self.nodes.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), grow)
    }
}

/// Weights of the corners at the point of a triangle that is nearest to `p`.
pub fn nearest_on_triangle(p: DVec3, corners: [DVec3; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let (u, v, w) = (b - a, c - a, p - a);
    let (uu, uv, vv, wu, wv) = (u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v));
    let span = uu * vv - uv * uv;
    let (s, t) = ((vv * wu - uv * wv) / span, (uu * wv - uv * wu) / span);
    if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
        return [1.0 - s - t, s, t];
    }
    // Outside of it, or without area: on one of the edges.
    let on_edge = |i: usize, j: usize| {
        let along = corners[j] - corners[i];
        let share = ((p - corners[i]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        (weights[i], weights[j]) = (1.0 - share, share);
        (weights, p.distance_squared(corners[i] + share * along))
    };
    let (weights, _) = [on_edge(1, 2), on_edge(2, 0)]
        .into_iter()
        .fold(on_edge(0, 1), |best, next| if next.1 < best.1 { next } else { best });
    weights
}
