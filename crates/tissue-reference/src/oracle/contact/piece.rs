//! Distances that contacts are made of, with their derivatives.

use super::surface::nearest_on_triangle;
use glam::{DMat3, DVec3};
use trocar_core::Pose;
use trocar_geometry::nearest_of_segments;
use trocar_tissue::Shape;

/// Step of the differences that give a curvature (m).
const STEP: f64 = 1e-9;

/// A normal that turns by more than this within a step has no curvature: the nearest place jumps.
const JUMP: f64 = 1e-3;

/// Below this distance (m) the way to a triangle has no direction.
const NO_DIRECTION: f64 = 1e-12;

/// A distance, as a function of the positions of some nodes.
#[derive(Clone)]
pub struct Piece<'a> {
    /// The nodes; those beyond `count` mean nothing.
    pub nodes: [usize; 4],
    pub count: usize,
    pub kind: Kind<'a>,
}

/// The two things between which a distance is measured.
#[derive(Clone)]
pub enum Kind<'a> {
    /// A node from a shape where its tool is at the end: signed.
    Shape(&'a Shape, Pose),
    /// An edge from a segment.
    Segment([DVec3; 2]),
    /// A triangle from a point.
    Point(DVec3),
    /// The first node from the triangle of the others.
    Triangle,
}

/// A distance and what it depends on.
#[derive(Clone, Copy)]
pub struct Measured {
    /// (m)
    pub distance: f64,
    /// By node.
    pub gradient: [DVec3; 4],
    /// By node: its share of the point that touches, negative for what is touched.
    pub shares: [f64; 4],
}

impl Piece<'_> {
    /// The distance with all nodes at `x`.
    pub fn at(&self, x: &[DVec3]) -> Measured {
        self.measure(self.positions(x))
    }

    fn positions(&self, x: &[DVec3]) -> [DVec3; 4] {
        let mut p = [DVec3::ZERO; 4];
        (0..self.count).for_each(|k| p[k] = x[self.nodes[k]]);
        p
    }

    fn measure(&self, p: [DVec3; 4]) -> Measured {
        match &self.kind {
            Kind::Shape(shape, pose) => {
                let nearest = shape.nearest(pose.inverse().transform(p[0]));
                let shares = [1.0, 0.0, 0.0, 0.0];
                Measured::along(nearest.distance, pose.rotation * nearest.normal, shares)
            }
            Kind::Segment(ends) => {
                let [s, t] = nearest_of_segments([p[0], p[1]], *ends);
                Measured::between(p[0].lerp(p[1], s) - ends[0].lerp(ends[1], t), [1.0 - s, s, 0.0, 0.0], DVec3::Z)
            }
            Kind::Point(point) => {
                let [u, v, w] = nearest_on_triangle(*point, [p[0], p[1], p[2]]);
                let out = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
                Measured::between(u * p[0] + v * p[1] + w * p[2] - *point, [u, v, w, 0.0], -out)
            }
            Kind::Triangle => {
                let [u, v, w] = nearest_on_triangle(p[0], [p[1], p[2], p[3]]);
                let out = (p[2] - p[1]).cross(p[3] - p[1]).normalize_or_zero();
                Measured::between(p[0] - u * p[1] - v * p[2] - w * p[3], [1.0, -u, -v, -w], out)
            }
        }
    }

    /// Second derivatives by pairs of nodes (1/m), by differences of the gradient; 0 where the
    /// nearest place jumps.
    pub fn curvature(&self, x: &[DVec3]) -> [[DMat3; 4]; 4] {
        let mut blocks = [[DMat3::ZERO; 4]; 4];
        let here = self.positions(x);
        for b in 0..self.count {
            for c in 0..3 {
                let moved = |by: f64| {
                    let mut p = here;
                    p[b][c] += by;
                    self.measure(p).gradient
                };
                let (after, before) = (moved(STEP), moved(-STEP));
                if (0..self.count).any(|a| (after[a] - before[a]).length() > JUMP) {
                    return [[DMat3::ZERO; 4]; 4];
                }
                for a in 0..self.count {
                    *blocks[a][b].col_mut(c) = (after[a] - before[a]) / (2.0 * STEP);
                }
            }
        }
        blocks
    }
}

impl Measured {
    /// Of a place with these `shares` at `off` from what it touches; `otherwise` is the direction
    /// of no distance.
    fn between(off: DVec3, shares: [f64; 4], otherwise: DVec3) -> Self {
        let distance = off.length();
        let normal = if distance > NO_DIRECTION { off / distance } else { otherwise };
        Self::along(distance, normal, shares)
    }

    fn along(distance: f64, normal: DVec3, shares: [f64; 4]) -> Self {
        Self { distance, gradient: shares.map(|share| share * normal), shares }
    }
}
