//! Surface smoothing.

use crate::TriMesh;
use glam::DVec3;

/// Taubin smoothing: `iterations` pairs of a shrinking (`lambda` > 0) and an inflating (`mu` < -`lambda`) umbrella step.
/// Taubin, "A signal processing approach to fair surface design", 1995.
pub fn taubin(mesh: &mut TriMesh, lambda: f64, mu: f64, iterations: usize) {
    let mut edges: Vec<(u32, u32)> = mesh
        .triangles
        .iter()
        .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
        .flat_map(|(a, b)| [(a, b), (b, a)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    let mut moved = mesh.vertices.clone();
    for _ in 0..iterations {
        for factor in [lambda, mu] {
            for neighbours in edges.chunk_by(|a, b| a.0 == b.0) {
                let i = neighbours[0].0 as usize;
                let sum: DVec3 = neighbours.iter().map(|(_, j)| mesh.vertices[*j as usize]).sum();
                moved[i] = mesh.vertices[i].lerp(sum / neighbours.len() as f64, factor);
            }
            std::mem::swap(&mut mesh.vertices, &mut moved);
        }
    }
}
