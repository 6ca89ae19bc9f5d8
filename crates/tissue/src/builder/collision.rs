//! Binds a collision surface to the elements of a body.

use crate::body::surface::Surface;
use crate::body::{BodyData, BoundVertex, CollisionSurface};
use glam::DVec3;
use trocar_geometry::{MeshDistance, Skin, TriMesh};

/// Range of the volume of a collision surface over that of the elements: one of another organ, or
/// in another unit, is outside.
const VOLUME_RANGE: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Smaller weights are rounding.
const MIN_WEIGHT: f64 = 1e-6;

/// A vertex that the binding would move farther than this (m) is too far from its element.
const MAX_MOVED: f64 = 1e-7;

/// A vertex of a surface on its element, by node in the original order.
struct Binding {
    element: u32,
    nodes: [u32; 4],
    weights: [f64; 4],
}

/// Binds `surface` to `body`. An error says what is wrong with it.
pub(super) fn bind(body: &mut BodyData, surface: &TriMesh) -> Result<(), String> {
    check(surface, body.rest.volume())?;
    let bindings = bindings(body, surface)?;
    let nodes = body.internal.len();
    let named: Vec<u32> = (nodes..nodes + surface.vertices.len()).map(|i| i as u32).collect();
    let (touching, areas) = Surface::over(surface, &named, nodes + surface.vertices.len());
    let by_area = AreaStiffness::of(body);
    let vertex = |(Binding { nodes, weights, .. }, area): (&Binding, &f64)| {
        let nodes = nodes.map(|node| body.internal[node as usize]);
        let stiffness = (by_area.at(&nodes, weights) * area) as f32;
        let weights = weights.map(|weight| weight as f32);
        BoundVertex { nodes, weights, spread: weights.iter().map(|weight| weight.abs()).sum(), stiffness }
    };
    let bound: Vec<BoundVertex> = bindings.iter().zip(&areas[nodes..]).map(vertex).collect();
    let mut stiffness = vec![0.0; nodes];
    for vertex in &bound {
        for (node, weight) in vertex.shares() {
            stiffness[node as usize] += weight.abs() * vertex.spread * vertex.stiffness;
        }
    }
    if let Some(lattice) = &mut body.lattice {
        let origin = body.origin;
        lattice.embed(bindings.iter().zip(&surface.vertices).map(|(binding, p)| (binding.element, *p - origin)));
    }
    let bindings = bindings.iter().map(|binding| (binding.nodes, binding.weights)).collect();
    body.collision = Some(CollisionSurface { mesh: surface.clone(), bindings });
    (body.surface, body.bound, body.bound_stiffness) = (touching, bound, stiffness);
    Ok(())
}

/// Checks a surface by itself, and against the `volume` of the elements (m3).
fn check(surface: &TriMesh, volume: f64) -> Result<(), String> {
    let count = surface.vertices.len();
    if surface.triangles.is_empty() {
        return Err("has no triangle".to_owned());
    }
    if let Some(i) = surface.vertices.iter().position(|v| !v.is_finite()) {
        return Err(format!("has vertex {i} at {}; coordinates are finite numbers", surface.vertices[i]));
    }
    if let Some(t) = surface.triangles.iter().position(|t| t.iter().any(|i| *i as usize >= count)) {
        return Err(format!("has triangle {t} of vertices {:?}; there are {count}", surface.triangles[t]));
    }
    if !surface.is_watertight() {
        let open = surface.open_edges();
        return Err(format!("is not closed: {open} edges have not exactly two triangles, or triangles face both ways"));
    }
    let share = surface.volume() / volume;
    if share < 0.0 {
        return Err("faces inward; its triangles must be counterclockwise seen from outside".to_owned());
    }
    if !VOLUME_RANGE.contains(&share) {
        let (least, most) = (VOLUME_RANGE.start(), VOLUME_RANGE.end());
        return Err(format!(
            "encloses {share:.3} of the volume of the elements; must be in [{least}, {most}] (is the unit metres?)"
        ));
    }
    Ok(())
}

/// The element and the weights of each vertex.
fn bindings(body: &BodyData, surface: &TriMesh) -> Result<Vec<Binding>, String> {
    let boundary = MeshDistance::new(&body.rest.boundary().0).map_err(|error| error.to_string())?;
    let mut all = Vec::with_capacity(surface.vertices.len());
    for (i, ((element, weights), p)) in
        Skin::bind(surface, &body.rest).bindings.iter().zip(&surface.vertices).enumerate()
    {
        let outside = weights.iter().any(|weight| *weight < 0.0);
        let away = if outside { boundary.unsigned(*p) } else { 0.0 };
        let nodes = body.rest.tets[*element as usize];
        let corners = nodes.map(|node| body.rest.vertices[node as usize]);
        let there: DVec3 = corners.iter().zip(weights).map(|(corner, weight)| *weight * *corner).sum();
        if away > body.median_edge || there.distance(*p) > MAX_MOVED {
            return Err(format!(
                "has vertex {i} {:.1} mm away from the elements; at most their median edge, {:.1} mm, and less beside \
                 flat elements",
                1e3 * away,
                1e3 * body.median_edge
            ));
        }
        let kept = weights.map(|weight| if weight.abs() < MIN_WEIGHT { 0.0 } else { weight });
        let sum: f64 = kept.iter().sum();
        let weights = kept.map(|weight| weight / sum);
        all.push(Binding { element: *element, nodes, weights });
    }
    Ok(all)
}

/// Stiffness of contacts by area of the boundary (N/m3).
struct AreaStiffness {
    /// By node (internal numbers); 0 inside.
    of: Vec<f64>,
    /// Of the boundary as a whole.
    mean: f64,
}

impl AreaStiffness {
    fn of(body: &BodyData) -> Self {
        let stiffness = || body.vertices.iter().map(|vertex| f64::from(vertex.contact_stiffness)).zip(&body.areas);
        let outer = || stiffness().filter(|(_, area)| **area > 0.0);
        let mean = outer().map(|(k, _)| k).sum::<f64>() / body.areas.iter().sum::<f64>();
        Self { of: stiffness().map(|(k, area)| if *area > 0.0 { k / area } else { 0.0 }).collect(), mean }
    }

    /// That of the boundary's nodes among those of an element, by their weights.
    fn at(&self, nodes: &[u32; 4], weights: &[f64; 4]) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (node, weight) in nodes.iter().zip(weights) {
            let stiffness = self.of[*node as usize];
            if stiffness > 0.0 {
                sum += weight.max(0.0) * stiffness;
                total += weight.max(0.0);
            }
        }
        if total > 0.0 { sum / total } else { self.mean }
    }
}
