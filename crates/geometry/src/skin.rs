//! Skins: a fine surface that follows a coarse tetrahedral body.

mod box_grid;

use crate::{TetMesh, TriMesh, closest_on_triangle};
use box_grid::BoxGrid;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Barycentric embedding of a surface in a tetrahedral body.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::{Skin, TetMesh, TriMesh};
///
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let body = TetMesh { vertices: corners, tets: vec![[0, 1, 2, 3]] };
/// let surface = TriMesh { vertices: vec![DVec3::splat(0.25)], ..TriMesh::default() };
/// let skin = Skin::bind(&surface, &body);
///
/// let stretched: Vec<DVec3> = body.vertices.iter().map(|p| 2.0 * *p).collect();
/// let mut positions = vec![DVec3::ZERO; 1];
/// skin.deform(&body, &stretched, &mut positions);
/// assert!(positions[0].distance(DVec3::splat(0.5)) < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct Skin {
    /// For each surface vertex: its element and four weights that sum to 1.
    pub bindings: Vec<(u32, [f64; 4])>,
}

/// Tolerance of the weights for a vertex to count as inside an element.
const INSIDE_TOLERANCE: f64 = 1e-9;
/// Weights lie at most this far below 0 or above 1. A vertex far outside the body would amplify
/// every strain of one element. It is bound closer to the body instead, so its rest position moves.
const MAX_EXTRAPOLATION: f64 = 3.0;

impl Skin {
    /// Binds each vertex of `surface` to `body` in the rest shape: to the element that contains it,
    /// or else to the element of the nearest boundary triangle with extrapolating weights.
    ///
    /// Vertices farther from the body than about an element's height are moved towards it to keep
    /// all weights in [-3, 4]. If no element has a positive volume, no vertex is bound.
    pub fn bind(surface: &TriMesh, body: &TetMesh) -> Self {
        let around = |points: &[DVec3]| {
            points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
        };
        let frames: Vec<Frame> = (0..body.tets.len()).into_par_iter().map(|t| Frame::of(&body.corners(t))).collect();
        let boxes: Vec<_> = (0..body.tets.len()).map(|t| around(&body.corners(t))).collect();
        // A cut plane beyond the body keeps the whole boundary, with the element of each triangle.
        let outside = body.cut_away(body.bounds().map_or(DVec3::ZERO, |(_, hi)| hi + DVec3::ONE), DVec3::ONE);
        let triangles: Vec<[DVec3; 3]> =
            outside.surface.triangles.iter().map(|t| t.map(|i| outside.surface.vertices[i as usize])).collect();
        let triangle_boxes: Vec<_> = triangles.iter().map(|triangle| around(triangle)).collect();
        let (Some(elements), Some(shell)) = (BoxGrid::new(&boxes), BoxGrid::new(&triangle_boxes)) else {
            return Self { bindings: Vec::new() };
        };
        let bind = |&p: &DVec3| {
            let mut inside: Option<(f64, u32, [f64; 4])> = None;
            for &t in elements.at(p) {
                let weights = frames[t as usize].weights(p);
                let least = weights.iter().copied().fold(f64::INFINITY, f64::min);
                if least >= -INSIDE_TOLERANCE && inside.is_none_or(|(best, ..)| least > best) {
                    inside = Some((least, t, weights));
                }
            }
            if let Some((_, t, weights)) = inside {
                return (t, weights);
            }
            let to = |k: u32| closest_on_triangle(&triangles[k as usize], p);
            match shell.nearest(p, |k| to(k).distance(p)) {
                Some(k) => {
                    let frame = &frames[outside.tets[k as usize] as usize];
                    (outside.tets[k as usize], limited(frame.weights(to(k)), frame.weights(p)))
                }
                // Only a NaN vertex has no nearest triangle.
                None => (0, [f64::NAN; 4]),
            }
        };
        Self { bindings: surface.vertices.par_iter().map(bind).collect() }
    }

    /// Writes the surface vertex positions (m) for node positions `nodes` (m) to `out`.
    ///
    /// `body` is the mesh of [`Skin::bind`]; `nodes` has one entry per node, `out` one per vertex.
    /// Affine motions of the body are followed exactly. Does not allocate.
    pub fn deform(&self, body: &TetMesh, nodes: &[DVec3], out: &mut [DVec3]) {
        for (vertex, &(t, weights)) in out.iter_mut().zip(&self.bindings) {
            let [a, b, c, d] = body.tets[t as usize].map(|node| nodes[node as usize]);
            *vertex = weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d;
        }
    }
}

/// Barycentric coordinates of an element.
struct Frame {
    origin: DVec3,
    /// Rows are the gradients of the last three weights (1/m).
    gradients: DMat3,
}

impl Frame {
    fn of(&[a, b, c, d]: &[DVec3; 4]) -> Self {
        Self { origin: a, gradients: DMat3::from_cols(b - a, c - a, d - a).inverse() }
    }

    fn weights(&self, p: DVec3) -> [f64; 4] {
        let w = self.gradients * (p - self.origin);
        [1.0 - w.x - w.y - w.z, w.x, w.y, w.z]
    }
}

/// The weights between `near` (a point of the element) and `wanted` that are closest to `wanted`
/// within the limit.
fn limited(near: [f64; 4], wanted: [f64; 4]) -> [f64; 4] {
    let mut share: f64 = 1.0;
    for (from, to) in near.into_iter().zip(wanted) {
        let limit = if to > from { 1.0 + MAX_EXTRAPOLATION } else { -MAX_EXTRAPOLATION };
        if !(-MAX_EXTRAPOLATION..=1.0 + MAX_EXTRAPOLATION).contains(&to) {
            share = share.min((limit - from) / (to - from));
        }
    }
    [0, 1, 2, 3].map(|i| near[i] + share * (wanted[i] - near[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LatticeMesher;
    use crate::shapes::Ball;

    fn body(cell: f64) -> TetMesh {
        LatticeMesher::uniform(cell).mesh_shape(&Ball(0.03), (DVec3::splat(-0.03), DVec3::splat(0.03))).unwrap()
    }

    /// Evenly distributed points on a sphere, as a surface without triangles.
    fn sphere(radius: f64, count: usize) -> TriMesh {
        let vertices = (0..count)
            .map(|i| {
                let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
                let turn = 2.399963229728653 * i as f64;
                radius * DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z)
            })
            .collect();
        TriMesh { vertices, ..TriMesh::default() }
    }

    #[test]
    fn affine_motions_are_followed_exactly() {
        let body = body(0.006);
        // Deep inside, just inside, on and just outside the surface.
        for radius in [0.004, 0.0295, 0.03, 0.0305] {
            let surface = sphere(radius, 2000);
            let skin = Skin::bind(&surface, &body);
            let map =
                DMat3::from_cols(DVec3::new(1.1, 0.2, -0.3), DVec3::new(0.0, 0.7, 0.4), DVec3::new(-0.2, 0.1, 1.3));
            let moved = |p: DVec3| map * p + DVec3::new(0.5, -2.0, 0.1);
            let nodes: Vec<DVec3> = body.vertices.iter().map(|&p| moved(p)).collect();
            let mut out = vec![DVec3::ZERO; surface.vertices.len()];
            skin.deform(&body, &nodes, &mut out);
            let worst = surface.vertices.iter().zip(&out).map(|(&p, &q)| moved(p).distance(q)).fold(0.0, f64::max);
            assert!(worst < 1e-12, "radius {radius}: {worst}");
            for (_, weights) in &skin.bindings {
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn inside_points_are_bound_to_the_element_that_contains_them() {
        let body = body(0.004);
        let skin = Skin::bind(&sphere(0.02, 3000), &body);
        assert!(skin.bindings.iter().all(|(_, w)| w.iter().all(|&w| w >= -1e-9)));
    }

    #[test]
    fn outside_points_are_bound_to_the_nearest_boundary_with_bounded_weights() {
        let body = body(0.006);
        let (surface, _) = body.boundary();
        for radius in [0.0304, 0.035, 0.3] {
            let points = sphere(radius, 200);
            let skin = Skin::bind(&points, &body);
            for (p, (t, weights)) in points.vertices.iter().zip(&skin.bindings) {
                let nearest = |triangle: &[u32; 3]| {
                    closest_on_triangle(&triangle.map(|i| surface.vertices[i as usize]), *p).distance(*p)
                };
                let truth = surface.triangles.iter().map(nearest).fold(f64::INFINITY, f64::min);
                let [a, b, c, d] = body.corners(*t as usize);
                let found = [[b, c, d], [a, d, c], [a, b, d], [a, c, b]]
                    .iter()
                    .map(|triangle| closest_on_triangle(triangle, *p).distance(*p))
                    .fold(f64::INFINITY, f64::min);
                assert!((found - truth).abs() < 1e-12, "radius {radius}: {found} instead of {truth}");
                assert!(weights.iter().all(|w| (-3.0 - 1e-9..=4.0 + 1e-9).contains(w)));
            }
        }
    }

    #[test]
    fn an_empty_body_binds_nothing_and_deforms_nothing() {
        let skin = Skin::bind(&sphere(1.0, 5), &TetMesh::default());
        let mut out = vec![DVec3::ONE; 5];
        skin.deform(&TetMesh::default(), &[], &mut out);
        assert_eq!(out, vec![DVec3::ONE; 5]);
    }
}
