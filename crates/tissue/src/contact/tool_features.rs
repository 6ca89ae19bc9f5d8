//! Where the surface of a body meets round parts of tools between its vertices.
//!
//! A capsule is all points near its axis, a segment. A segment is nearest to a surface at a vertex,
//! at a point of an edge, or at an end of the segment above a triangle's inside. Vertices are
//! examined one by one ([`super::ContactSet`]). Here are the other two: edges against the axis and
//! triangles against its ends. Together they are all ways in which an axis can go through a surface
//! (Chen and others 2025, "Offset geometric contact").
//!
//! A pair counts where its distance is a minimum, whether or not another pair is nearer: a rod that
//! lies flat touches at both its ends. An edge counts if the axis is outside of it, towards neither
//! of its triangles. In a shallow valley it counts too ([`VALLEY`]), because what presses on an
//! edge makes one.

use super::site::Site;
use crate::body::surface::{Surface, foot};
use crate::state::FeatureKey;
use glam::Vec3A;
use trocar_geometry::nearest_of_segments;

/// Distance of a point of the axis from the surface below which it has no direction (m).
const MIN_DISTANCE: f32 = 1e-6;

/// Sine of the greatest angle by which the axis is towards a triangle of an edge.
const VALLEY: f32 = 0.5;

/// A point of an edge or of a triangle's inside that is near an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Feature {
    pub key: FeatureKey,
    pub site: Site,
}

impl Feature {
    /// The feature's site where its vertices are at `x`; None if it is not nearest to the axis
    /// there.
    pub fn moved(&self, x: impl Fn(u32) -> Vec3A, axis: [Vec3A; 2]) -> Option<Site> {
        let vertices = self.site.vertices;
        let inside = |share: &f32| *share > 0.0 && *share < 1.0;
        let weights = if vertices[2] == vertices[0] {
            let ends = [x(vertices[0]).as_dvec3(), x(vertices[1]).as_dvec3()];
            let share = nearest_of_segments(ends, axis.map(|p| p.as_dvec3()))[0] as f32;
            inside(&share).then_some([1.0 - share, share, 0.0])?
        } else {
            let foot = foot(axis[usize::from(self.key.1)], vertices.map(x));
            foot.weights.iter().all(inside).then_some(foot.weights)?
        };
        Some(Site { vertices, weights })
    }
}

/// The features of `triangles` of a surface, vertices at `x`, within `reach` (m) of the axis from
/// `a` to `b`, each once, by key.
pub(super) fn find(
    surface: &Surface,
    x: &[Vec3A],
    triangles: &[u32],
    axis: [Vec3A; 2],
    reach: f32,
    features: &mut Vec<Feature>,
) {
    features.clear();
    let ends = if axis[0] == axis[1] { 1 } else { 2 };
    for t in triangles {
        let mut vertices = surface.triangles[*t as usize];
        for k in 0..3 {
            // The two triangles of an edge run along it in opposite directions, so one of them has
            // it.
            let edge = [vertices[k], vertices[(k + 1) % 3]];
            if edge[0] < edge[1] {
                features.extend(of_edge(surface, x, edge, axis, reach));
            }
        }
        let normal = normal(x, vertices);
        // The name begins with the smallest vertex; the turn stays.
        let least = (0..3).min_by_key(|k| vertices[*k]).unwrap_or(0);
        vertices.rotate_left(least);
        let [p, q, r] = vertices.map(|i| x[i as usize]);
        let far = reach + (q - p).length_squared().max((r - p).length_squared()).sqrt();
        for (end, place) in axis.iter().enumerate().take(ends) {
            // Rounding is far smaller than a percent.
            if place.distance(p) > 1.01 * far {
                continue;
            }
            let foot = foot(*place, vertices.map(|i| x[i as usize]));
            let inside = foot.weights.iter().all(|weight| *weight > 0.0);
            if inside && is_near(foot.off, reach) && foot.off.dot(normal) > 0.0 {
                features.push(Feature { key: (vertices, end as u8), site: Site { vertices, weights: foot.weights } });
            }
        }
    }
    features.sort_unstable_by_key(|feature| feature.key);
    // Edges at which four triangles meet have come twice.
    features.dedup_by_key(|feature| feature.key);
}

/// Whether two segments may be within `reach` (m) of each other: false if a ball around the one is
/// too far from the other's line.
fn may_be_near(edge: [Vec3A; 2], axis: [Vec3A; 2], reach: f32) -> bool {
    let along = axis[1] - axis[0];
    let off = 0.5 * (edge[0] + edge[1]) - axis[0];
    let share = (off.dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    // Rounding is far smaller than a percent.
    (off - share * along).length() <= 1.01 * (reach + 0.5 * edge[0].distance(edge[1]))
}

/// The point of an edge that is nearest to the axis, if it counts. `edge` is ascending.
fn of_edge(surface: &Surface, x: &[Vec3A], edge: [u32; 2], axis: [Vec3A; 2], reach: f32) -> Option<Feature> {
    let [i, k] = edge;
    let ends = [x[i as usize], x[k as usize]];
    if !may_be_near(ends, axis, reach) {
        return None;
    }
    let [share, other] = nearest_of_segments(ends.map(|p| p.as_dvec3()), axis.map(|p| p.as_dvec3())).map(|s| s as f32);
    let off = axis[0] + other * (axis[1] - axis[0]) - (ends[0] + share * (ends[1] - ends[0]));
    if !(share > 0.0 && share < 1.0 && is_near(off, reach)) {
        return None;
    }
    let along = ends[1] - ends[0];
    let mut out = Vec3A::ZERO;
    for t in surface.fan(i) {
        let vertices = surface.triangles[*t as usize];
        let Some(opposite) = vertices.contains(&k).then(|| vertices.iter().find(|v| **v != i && **v != k)).flatten()
        else {
            continue;
        };
        let side = x[*opposite as usize] - ends[0];
        let inwards = side - along * (side.dot(along) / along.length_squared());
        if off.dot(inwards) > VALLEY * off.length() * inwards.length() {
            return None;
        }
        out += normal(x, vertices).normalize_or_zero();
    }
    let site = Site { vertices: [i, k, i], weights: [1.0 - share, share, 0.0] };
    (off.dot(out) > 0.0).then_some(Feature { key: (site.vertices, 0), site })
}

fn is_near(off: Vec3A, reach: f32) -> bool {
    (MIN_DISTANCE..=reach).contains(&off.length())
}

fn normal(x: &[Vec3A], vertices: [u32; 3]) -> Vec3A {
    let [p, q, r] = vertices.map(|i| x[i as usize]);
    (q - p).cross(r - p)
}
