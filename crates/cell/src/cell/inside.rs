//! The parts of segments that lie inside an organ.

use crate::World;
use glam::DVec3;
use trocar_geometry::{MeshDistance, TriMesh};

/// A part of a segment inside an element of an organ.
pub(super) struct Crossing {
    /// The segment's number.
    pub segment: usize,
    /// The part inside, as shares of the segment.
    pub part: [f64; 2],
    /// The element's nodes.
    pub nodes: [u32; 4],
}

/// The parts of `segments` inside an organ, by element. What is outside of the organ's collision
/// surface does not count.
pub(super) fn crossings(world: &World, organ: usize, segments: &[[DVec3; 2]]) -> Vec<Crossing> {
    let ends = segments.iter().flatten();
    let (low, high) = ends.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let body = &world.model.bodies()[organ];
    let places = world.state.positions(&world.model, organ);
    let side = |p: &DVec3| p.cmplt(low).bitmask() | p.cmpgt(high).bitmask() << 3;
    let sides: Vec<u32> = places.iter().map(side).collect();
    let mut found = Vec::new();
    if sides.iter().fold(u32::MAX, |all, sides| all & sides) != 0 {
        // The whole organ is beyond one side of the box round the segments.
        return found;
    }
    for nodes in body.tets() {
        let t = nodes.map(|i| i as usize);
        // All corners are beyond one side of the box.
        if t.iter().fold(u32::MAX, |all, i| all & sides[*i]) != 0 {
            continue;
        }
        let corners = t.map(|i| places[i]);
        let crossing = |(segment, ends)| Some(Crossing { segment, part: inside(&corners, ends)?, nodes: *nodes });
        found.extend(segments.iter().enumerate().filter_map(crossing));
    }
    if let Some(surface) = body.collision_surface().filter(|_| !found.is_empty()) {
        let vertices = world.state.collision_positions(&world.model, organ);
        let mesh = TriMesh { vertices, triangles: surface.mesh().triangles.clone(), colors: Vec::new() };
        // A surface that is not finite ends the episode.
        if let Ok(field) = MeshDistance::new(&mesh) {
            found.retain(|Crossing { segment, part, .. }| {
                let [from, to] = segments[*segment];
                field.winding(from.lerp(to, 0.5 * (part[0] + part[1]))) > 0.5
            });
        }
    }
    found
}

/// The part of a segment inside a tetrahedron, as shares of the segment, if there is one.
fn inside(corners: &[DVec3; 4], [from, to]: &[DVec3; 2]) -> Option<[f64; 2]> {
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    // Each face with the corner opposite to it.
    for [a, b, c, d] in [[0, 1, 2, 3], [0, 3, 1, 2], [0, 2, 3, 1], [1, 3, 2, 0]] {
        let [a, b, c, d] = [a, b, c, d].map(|i: usize| corners[i]);
        let normal = (b - a).cross(c - a);
        let inwards = normal * (d - a).dot(normal).signum();
        let (one, two) = ((*from - a).dot(inwards), (*to - a).dot(inwards));
        if one < 0.0 && two < 0.0 {
            return None;
        }
        let share = one / (one - two);
        if one < 0.0 {
            begin = begin.max(share);
        } else if two < 0.0 {
            end = end.min(share);
        }
    }
    (begin < end).then_some([begin, end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_of_a_segment_is_inside_a_tetrahedron_is_found() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let at = |from: [f64; 3], to: [f64; 3]| {
            let [begin, end] = inside(&corners, &[from.into(), to.into()])?;
            Some(DVec3::from(from).lerp(to.into(), 0.5 * (begin + end)))
        };
        let near = |at: Option<DVec3>, to: [f64; 3]| at.is_some_and(|at| at.distance(to.into()) < 1e-12);
        assert!(near(at([0.1, 0.1, -1.0], [0.1, 0.1, 1.8]), [0.1, 0.1, 0.4]));
        assert!(near(at([0.1, 0.1, 0.1], [0.1, 0.1, 0.3]), [0.1, 0.1, 0.2]), "all of it");
        assert_eq!(at([0.1, 0.1, -1.0], [0.1, 0.1, -0.01]), None, "it ends before");
        assert_eq!(at([0.5, 0.5, 0.1], [1.0, 1.0, 0.1]), None);
        // For either orientation of the corners.
        let turned = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::Z];
        assert!(inside(&turned, &[DVec3::splat(0.2), DVec3::ONE]).is_some());
    }
}
