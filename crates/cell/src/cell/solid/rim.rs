//! The rim of the pinned part of a surface: edges and vertices that cannot move, of triangles that
//! do.
//!
//! Their outer side is where the tissue around them leaves room now. Tissue that is pressed down
//! beside a rim lays it bare from the side.

use super::surface_vertex::SurfaceVertex;
use crate::World;
use glam::DVec3;
use std::collections::BTreeMap;

/// The vertices around the rims of all organs, where they are now.
#[derive(Clone, Debug, Default)]
pub(super) struct RimPlaces {
    /// Organ and vertex of its surface.
    vertices: Vec<(usize, u32)>,
    /// (m)
    places: Vec<DVec3>,
    /// Numbers of the vertices, while rims are added.
    known: BTreeMap<(usize, u32), usize>,
}

impl RimPlaces {
    /// Number of a vertex of an organ, at `place` (m).
    fn number(&mut self, organ: usize, vertex: u32, place: DVec3) -> usize {
        *self.known.entry((organ, vertex)).or_insert_with(|| {
            self.vertices.push((organ, vertex));
            self.places.push(place);
            self.places.len() - 1
        })
    }

    /// No more rims are added.
    pub fn finish(&mut self) {
        self.known = BTreeMap::new();
    }

    /// Reads where the vertices are now.
    pub fn follow(&mut self, world: &World) {
        for ((organ, vertex), place) in self.vertices.iter().zip(&mut self.places) {
            *place = SurfaceVertex::place(world, *organ, *vertex);
        }
    }
}

/// An edge or a vertex at a rim, with the triangles around it.
#[derive(Clone, Debug)]
pub(super) struct Rim {
    /// Numbers of its ends; twice the same for a vertex.
    ends: [usize; 2],
    /// Numbers of the vertices of its triangles.
    triangles: Vec<[usize; 3]>,
}

impl Rim {
    /// The edge or vertex between the vertices `ends` of an organ, with its `triangles`.
    pub fn new(
        organ: usize,
        ends: [u32; 2],
        triangles: &[[u32; 3]],
        place: impl Fn(u32) -> DVec3,
        places: &mut RimPlaces,
    ) -> Self {
        let mut number = |vertex: u32| places.number(organ, vertex, place(vertex));
        Self { ends: ends.map(&mut number), triangles: triangles.iter().map(|t| t.map(&mut number)).collect() }
    }

    /// Whether it is a vertex.
    pub fn is_vertex(&self) -> bool {
        self.ends[0] == self.ends[1]
    }

    /// Whether `direction` leads from it out of the organ: to the side of its pseudonormal
    /// (Baerentzen and Aanaes 2005, "Signed distance computation using the angle weighted
    /// pseudonormal").
    pub fn leads_out(&self, direction: DVec3, places: &RimPlaces) -> bool {
        let place = |i: usize| places.places[i];
        let from = place(self.ends[0]);
        let mut pseudonormal = DVec3::ZERO;
        for triangle in &self.triangles {
            let k = (0..3).find(|k| triangle[*k] == self.ends[0]).unwrap_or(0);
            let [one, other] = [1, 2].map(|n| place(triangle[(k + n) % 3]) - from);
            let across = one.cross(other);
            let weight = if self.is_vertex() { libm::atan2(across.length(), one.dot(other)) } else { 1.0 };
            pseudonormal += weight * across.normalize_or_zero();
        }
        direction.dot(pseudonormal) > 0.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use trocar_testing::tube::{ONE_END, two_tubes};
    use trocar_tissue::SolverSettings;

    /// A pinned square in z = 0 with x < 0, and a square that moves with x > 0, at whose far side z
    /// is `far`. The rim is the edge along y and its vertices.
    fn rim(ends: [u32; 2], far: f64) -> (Rim, RimPlaces) {
        let vertices =
            [[-1.0, -1.0, 0.0], [0.0, -1.0, 0.0], [1.0, -1.0, far], [-1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, far]];
        let all = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
        let around: Vec<[u32; 3]> = all.into_iter().filter(|t| ends.iter().all(|i| t.contains(i))).collect();
        let mut places = RimPlaces::default();
        let rim = Rim::new(0, ends, &around, |i| vertices[i as usize].into(), &mut places);
        (rim, places)
    }

    #[test]
    fn a_rim_pushes_to_where_the_tissue_beside_it_leaves_room() {
        let leads_out = |ends: [u32; 2], far: f64, x: f64, z: f64| {
            let (rim, places) = rim(ends, far);
            rim.leads_out(DVec3::new(x, 0.0, z).normalize(), &places)
        };
        for ends in [[1, 4], [1, 1], [4, 4]] {
            assert!(leads_out(ends, 0.0, 0.0, 1.0) && leads_out(ends, 0.0, 1.0, 0.1), "up from a plane");
            assert!(!leads_out(ends, 0.0, 0.0, -1.0) && !leads_out(ends, 0.0, 1.0, -0.1));
        }
        // The tissue beside it is pressed down: the edge is bare from the side.
        assert!(leads_out([1, 4], -3.0, 1.0, -0.5) && !leads_out([1, 4], -3.0, -1.0, 0.1));
        // It is lifted: no push into it.
        assert!(!leads_out([1, 4], 3.0, 1.0, 0.5) && leads_out([1, 4], 3.0, -1.0, 0.5));
    }

    /// A vertex at the foot of a wall on a floor. The wall's face is split into many triangles.
    #[test]
    fn a_vertex_does_not_count_the_triangles_of_a_face() {
        let mut places = RimPlaces::default();
        // Floor z = 0 for y < 0, seen from above; wall y = 0 for z < 0, seen from y > 0.
        let fan = |k: u32| 0.5 * std::f64::consts::PI * f64::from(k) / 16.0;
        let place = |i: u32| match i {
            0 => DVec3::ZERO,
            1 => -DVec3::Y,
            _ => DVec3::new(libm::cos(fan(i - 2)), 0.0, -libm::sin(fan(i - 2))),
        };
        let mut around = vec![[0, 1, 2]];
        around.extend((2..18).map(|i| [0, i, i + 1]));
        let rim = Rim::new(0, [0, 0], &around, place, &mut places);
        // Both faces have a right angle there, so the sides of the half-space are alike.
        assert!(
            rim.leads_out(DVec3::new(0.0, -0.9, 1.0), &places) && rim.leads_out(DVec3::new(0.0, 1.0, -0.9), &places)
        );
        assert!(
            !rim.leads_out(DVec3::new(0.0, -1.0, 0.9), &places) && !rim.leads_out(DVec3::new(0.0, 0.9, -1.0), &places)
        );
    }

    #[test]
    fn places_follow_the_tissue() {
        let world = World::new(&two_tubes(ONE_END, 4e-3), SolverSettings::default(), 1).unwrap();
        let mut places = RimPlaces::default();
        let numbers = [(0, 3), (1, 5), (0, 3)].map(|(organ, vertex)| places.number(organ, vertex, DVec3::ZERO));
        assert_eq!(numbers, [0, 1, 0]);
        places.follow(&world);
        let now = [(0, 3), (1, 5)].map(|(organ, node)| world.state.position(&world.model, organ, node));
        assert!(places.places == now && now[0] != DVec3::ZERO);
    }
}
