//! Which edges and triangles touch the axis of a round shape, and how hard (decision 0056).
//!
//! It says in double precision and at the present place what the model promises: an edge touches
//! where it is nearest to the axis and the axis is outside of it, a triangle below an end of the
//! axis that is above its inside.

use super::surface::{Edge, nearest_on_triangle};
use glam::DVec3;
use trocar_geometry::nearest_of_segments;
use trocar_tissue::Shape;

/// Stiffness of a point between vertices over that of the vertices around.
const STIFFNESS: f64 = 4.0;

/// Sine of the greatest angle by which the axis may lie towards a triangle of an edge.
const VALLEY: f64 = 0.5;

/// The axis of a round shape in its tool's frame, and its radius (m).
pub fn axis(shape: &Shape) -> Option<([DVec3; 2], f64)> {
    match shape {
        Shape::Sphere { centre, radius } => Some(([*centre; 2], *radius)),
        Shape::Capsule { ends, radius } => Some((*ends, *radius)),
        Shape::HalfSpace { .. } | Shape::Box { .. } | Shape::Hull(_) => None,
    }
}

/// Stiffness of an edge against an axis with these ends (N/m), nodes at `x`; None if it does not
/// touch. `of` is the stiffness of a node.
pub fn of_edge((nodes, triangles): &Edge, axis: [DVec3; 2], x: &[DVec3], of: &[f64]) -> Option<f64> {
    let [from, to] = nodes.map(|i| x[i]);
    let [s, t] = nearest_of_segments([from, to], axis);
    if s <= 0.0 || s >= 1.0 {
        return None;
    }
    let off = axis[0].lerp(axis[1], t) - from.lerp(to, s);
    let along = (to - from).normalize_or_zero();
    let third = |t: &[usize; 3]| t.iter().find(|i| !nodes.contains(i)).map_or(from, |i| x[*i]);
    let inwards = |t: &[usize; 3]| (third(t) - from).reject_from_normalized(along).normalize_or_zero();
    if triangles.iter().any(|t| off.dot(inwards(t)) > VALLEY * off.length()) {
        return None;
    }
    let out: DVec3 = triangles.iter().map(|t| normal(t.map(|i| x[i])).normalize_or_zero()).sum();
    (off.dot(out) > 0.0).then(|| stiffness(&[1.0 - s, s], &nodes.map(|i| of[i])))
}

/// Stiffness of a triangle against a point (N/m); None if it does not touch.
pub fn of_triangle(t: [usize; 3], point: DVec3, x: &[DVec3], of: &[f64]) -> Option<f64> {
    let corners = t.map(|i| x[i]);
    let weights = nearest_on_triangle(point, corners);
    let out = normal(corners);
    let inside = weights.iter().all(|w| *w > 0.0) && (point - corners[0]).dot(out) > 0.0;
    inside.then(|| stiffness(&weights, &t.map(|i| of[i])))
}

fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// All of it in the middle of an edge, nothing at a vertex.
fn stiffness(weights: &[f64], of: &[f64]) -> f64 {
    let pairs = (0..weights.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let inner: f64 = pairs.map(|(a, b)| weights[a] * weights[b]).sum();
    STIFFNESS * (4.0 * inner).min(1.0) * weights.iter().zip(of).map(|(w, k)| w * k).sum::<f64>()
}
