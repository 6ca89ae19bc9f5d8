//! Shapes with known properties, for tests.

use crate::{SignedDistance, TriMesh};
use glam::DVec3;
use trocar_core::Random;

/// An axis-aligned cube of `edge` (m) about `centre`, outward.
pub(crate) fn cube(centre: DVec3, edge: f64) -> TriMesh {
    let vertices = (0..8)
        .map(|c| centre + edge * (DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64) - 0.5))
        .collect();
    let quads = [[0u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices, triangles, colors: Vec::new() }
}

/// A subdivided octahedron projected on the sphere of `radius` (m) about the origin: 8 * 4^levels
/// triangles, outward.
pub(crate) fn icosphere(levels: usize, radius: f64) -> TriMesh {
    let mut vertices = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for &[a, b, c] in &triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i as usize] + vertices[j as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    vertices.iter_mut().for_each(|v| *v *= radius);
    TriMesh { vertices, triangles, colors: Vec::new() }
}

/// Ball about the origin.
pub(crate) struct Ball(pub f64);

impl SignedDistance for Ball {
    fn distance(&self, p: DVec3) -> f64 {
        p.length() - self.0
    }
}

/// Torus about the z axis: radius of the ring, radius of the tube.
pub(crate) struct Torus(pub f64, pub f64);

impl SignedDistance for Torus {
    fn distance(&self, p: DVec3) -> f64 {
        libm::hypot(libm::hypot(p.x, p.y) - self.0, p.z) - self.1
    }
}

/// `count` reproducible points in [-1, 1]^3.
pub(crate) fn scattered(count: usize) -> Vec<DVec3> {
    let random = Random::new(1);
    (0..count as u64).map(|i| DVec3::from([0, 1, 2].map(|axis| random.symmetric(3 * i + axis)))).collect()
}
