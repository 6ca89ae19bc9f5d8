//! Surface smoothing.

use crate::TriMesh;
use glam::DVec3;

/// Taubin smoothing (G. Taubin, "A signal processing approach to fair surface design", 1995):
/// `iterations` pairs of a shrinking (`lambda` > 0) and an inflating (`mu` < -`lambda`) step. A
/// step moves every vertex by the factor times the vector to the mean of its neighbours. Triangles
/// do not change.
pub fn taubin(mesh: &mut TriMesh, lambda: f64, mu: f64, iterations: usize) {
    let (start, neighbours) = neighbours(mesh);
    let mut moved = mesh.vertices.clone();
    for step in 0..2 * iterations {
        let factor = if step % 2 == 0 { lambda } else { mu };
        for (v, target) in moved.iter_mut().enumerate() {
            let ring = &neighbours[start[v]..start[v + 1]];
            let here = mesh.vertices[v];
            *target = here;
            if !ring.is_empty() {
                let mean = ring.iter().map(|&n| mesh.vertices[n as usize]).sum::<DVec3>() / ring.len() as f64;
                *target += factor * (mean - here);
            }
        }
        std::mem::swap(&mut mesh.vertices, &mut moved);
    }
}

/// `(start, list)`: the neighbours of vertex v are `list[start[v]..start[v + 1]]`.
fn neighbours(mesh: &TriMesh) -> (Vec<usize>, Vec<u32>) {
    let mut edges: Vec<(u32, u32)> =
        mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)]).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut start = vec![0; mesh.vertices.len() + 1];
    for &(from, _) in &edges {
        start[from as usize + 1] += 1;
    }
    for v in 0..mesh.vertices.len() {
        start[v + 1] += start[v];
    }
    (start, edges.into_iter().map(|(_, to)| to).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{icosphere, scattered};

    #[test]
    fn a_noisy_sphere_becomes_smooth_and_keeps_its_volume() {
        let clean = icosphere(5, 0.05);
        let mut mesh = clean.clone();
        for (v, shift) in mesh.vertices.iter_mut().zip(scattered(clean.vertices.len())) {
            *v += 5e-4 * shift;
        }
        let roughness = |m: &TriMesh| m.vertices.iter().map(|v| (v.length() - 0.05).powi(2)).sum::<f64>();
        let before = roughness(&mesh);
        taubin(&mut mesh, 0.5, -0.53, 20);
        assert!(roughness(&mesh) < 0.2 * before, "{} of {before}", roughness(&mesh));
        assert!((mesh.volume() / clean.volume() - 1.0).abs() < 0.01, "{}", mesh.volume() / clean.volume());
        assert_eq!(mesh.triangles, clean.triangles);
    }

    #[test]
    fn a_clean_sphere_does_not_shrink() {
        let clean = icosphere(5, 1.0);
        let mut mesh = clean.clone();
        taubin(&mut mesh, 0.5, -0.53, 20);
        assert!((mesh.volume() / clean.volume() - 1.0).abs() < 0.01, "{}", mesh.volume() / clean.volume());
    }

    #[test]
    fn a_vertex_without_neighbours_does_not_move() {
        let mut mesh = TriMesh { vertices: vec![DVec3::ONE], ..TriMesh::default() };
        taubin(&mut mesh, 0.5, -0.53, 3);
        assert_eq!(mesh.vertices, [DVec3::ONE]);
    }
}
