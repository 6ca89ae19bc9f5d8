//! Shared by the mesher tests: shapes defined by closures, and a check of meshes.

#![allow(dead_code, reason = "each test file uses a part")]

use glam::DVec3;
use trocar_geometry::{SignedDistance, TetMesh};

/// A shape defined by a closure.
pub struct Shape<F: Fn(DVec3) -> f64 + Sync>(pub F);

impl<F: Fn(DVec3) -> f64 + Sync> SignedDistance for Shape<F> {
    fn distance(&self, p: DVec3) -> f64 {
        (self.0)(p)
    }
}

/// Panics unless the tets conform and every edge of their boundary has two triangles that traverse
/// it in opposite directions. Returns the number of boundary nodes where the surface touches
/// itself.
pub fn check_conforming(mesh: &TetMesh) -> usize {
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for &[a, b, c, d] in &mesh.tets {
        for mut face in [[a, b, c], [a, b, d], [a, c, d], [b, c, d]] {
            face.sort_unstable();
            faces.push(face);
        }
    }
    faces.sort_unstable();
    assert!(faces.chunk_by(|a, b| a == b).all(|same| same.len() <= 2), "a face of three tets");
    let open = faces.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).count();
    let (surface, nodes) = mesh.boundary();
    assert_eq!(surface.triangles.len(), open);
    assert_eq!(surface.vertices.len(), nodes.len());

    let mut edges: Vec<[u32; 2]> = surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    assert!(edges.windows(2).all(|w| w[0] != w[1]), "an edge with two triangles in the same direction");
    assert!(edges.iter().all(|&[a, b]| edges.binary_search(&[b, a]).is_ok()), "an open edge");

    // Walk around each vertex. A triangle that is not reached belongs to a second fan.
    let mut next = std::collections::BTreeMap::new();
    for &[a, b, c] in &surface.triangles {
        for (centre, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            next.insert((centre, from), to);
        }
    }
    let mut touching = 0;
    for v in 0..surface.vertices.len() as u32 {
        let spokes: Vec<u32> = next.range((v, 0)..=(v, u32::MAX)).map(|(&(_, from), _)| from).collect();
        let (mut at, mut length) = (spokes[0], 0);
        loop {
            at = next[&(v, at)];
            length += 1;
            if at == spokes[0] {
                break;
            }
        }
        touching += usize::from(length != spokes.len());
    }
    touching
}
