//! The search tree over all triangles and the exact first hit of a ray.

use glam::DVec3;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use std::sync::OnceLock;

/// Margin of the triangles' boxes in units of half the scene's extent. It covers single-precision
/// rounding.
const BOX_MARGIN: f32 = 1e-5;
/// Tolerance of the barycentric coordinates. It closes the gap between two triangles.
const EDGE_TOLERANCE: f64 = 1e-9;

/// A single-precision tree finds candidates; their intersection is computed in double precision.
/// The tree's builder has absolute tolerances, so the scene is shifted and scaled into the unit
/// cube for it.
pub(crate) struct Tracer {
    /// Corners of the triangles (m).
    triangles: Vec<[DVec3; 3]>,
    /// Built for the first ray. What is drawn needs it only where triangles are equally near.
    tree: OnceLock<Tree>,
    centre: DVec3,
    /// Half the largest extent (m).
    radius: f64,
}

struct Tree {
    bvh: CwBvh,
    /// Triangles in the order of the tree: first corner and the two edges from it (m).
    corners: Vec<[DVec3; 3]>,
}

/// First intersection of a ray with the scene.
#[derive(Clone, Copy)]
pub(crate) struct Hit {
    /// Index among the triangles given to [`Tracer::new`].
    pub triangle: u32,
    /// Ray parameter, in units of the ray's direction.
    pub t: f64,
    /// Barycentric coordinates of the second and third corner.
    pub u: f64,
    pub v: f64,
}

struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Tracer {
    /// `triangles` are three finite corners each.
    pub fn new(triangles: &[[DVec3; 3]]) -> Self {
        let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
        for p in triangles.as_flattened() {
            (low, high) = (low.min(*p), high.max(*p));
        }
        if triangles.is_empty() {
            (low, high) = (DVec3::ZERO, DVec3::ZERO);
        }
        let centre = (low + high) / 2.0;
        let radius = ((high - low).max_element() / 2.0).max(1e-9);
        Self { triangles: triangles.to_vec(), tree: OnceLock::new(), centre, radius }
    }

    /// Corners of the triangles (m).
    pub fn triangles(&self) -> &[[DVec3; 3]] {
        &self.triangles
    }

    fn tree(&self) -> &Tree {
        self.tree.get_or_init(|| {
            let scaled = |p: DVec3| ((p - self.centre) / self.radius).as_vec3a();
            let bounds = self.triangles.iter().map(|corners| {
                let [a, b, c] = corners.map(scaled);
                Bounds(Aabb { min: a.min(b).min(c) - BOX_MARGIN, max: a.max(b).max(c) + BOX_MARGIN })
            });
            let bounds: Vec<Bounds> = bounds.collect();
            let bvh = build_cwbvh(&bounds, BvhBuildParams::fast_build(), &mut std::time::Duration::default());
            let corners = bvh.primitive_indices.iter().map(|&i| edges(self.triangles[i as usize])).collect();
            Tree { bvh, corners }
        })
    }

    /// First hit with `t` in (0, `reach`]. `direction` need not be of unit length.
    pub fn first(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut nearest = reach;
        let (ray, entry, unit) = self.tree_ray(origin, direction, reach)?;
        let (mut ignored, Tree { bvh, corners }) = (RayHit::none(), self.tree());
        bvh.ray_traverse(ray, &mut ignored, |_, id| match intersect(&corners[id], origin, direction) {
            Some((t, u, v)) if t > 0.0 && t <= nearest => {
                nearest = t;
                best = Some(Hit { triangle: bvh.primitive_indices[id], t, u, v });
                ((t - entry) * unit).max(0.0) as f32
            }
            _ => f32::INFINITY,
        });
        best
    }

    /// Whether a surface lies on the ray with `t` in (0, `reach`].
    pub fn blocked(&self, origin: DVec3, direction: DVec3, reach: f64) -> bool {
        let Some((ray, _, _)) = self.tree_ray(origin, direction, reach) else { return false };
        let Tree { bvh, corners } = self.tree();
        !bvh.ray_traverse_miss(ray, |_, id| match intersect(&corners[id], origin, direction) {
            Some((t, _, _)) if t > 0.0 && t <= reach => 0.0,
            _ => f32::INFINITY,
        })
    }

    /// The ray in the coordinates of the tree. It starts where the ray enters the scene's bounding
    /// sphere, so that single precision suffices from any distance. Also returns the `t` of that
    /// entry and the tree length per unit of `t`.
    fn tree_ray(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<(Ray, f64, f64)> {
        if self.triangles.is_empty() {
            return None;
        }
        let to_centre = (self.centre - origin) / self.radius;
        let unit = direction.length() / self.radius;
        let d = direction.normalize_or_zero();
        let along = to_centre.dot(d);
        let aside2 = to_centre.length_squared() - along * along;
        const SPHERE2: f64 = 3.01;
        if aside2 > SPHERE2 {
            return None;
        }
        let half = (SPHERE2 - aside2).sqrt();
        if along + half < 0.0 {
            return None;
        }
        let start = (along - half).max(0.0);
        let tmax = reach * unit - start;
        if tmax < 0.0 {
            return None;
        }
        let ray = Ray::new((d * start - to_centre).as_vec3a(), d.as_vec3a(), 0.0, (tmax * 1.00001) as f32);
        Some((ray, start / unit, unit))
    }
}

/// First corner of a triangle and the two edges from it.
pub(super) fn edges([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    [a, b - a, c - a]
}

/// Two-sided intersection in double precision (Moeller and Trumbore 1997).
pub(super) fn intersect([a, ab, ac]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, f64, f64)> {
    let p = direction.cross(*ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - *a;
    let u = s.dot(p) / det;
    if !(-EDGE_TOLERANCE..=1.0 + EDGE_TOLERANCE).contains(&u) {
        return None;
    }
    let q = s.cross(*ab);
    let v = direction.dot(q) / det;
    if v < -EDGE_TOLERANCE || u + v > 1.0 + EDGE_TOLERANCE {
        return None;
    }
    Some((ac.dot(q) / det, u, v))
}
