//! How good the elements of a tetrahedral mesh are.

use crate::TetMesh;
use crate::tet_mesh::EDGES;
use glam::DVec3;

/// Element quality of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TetQuality {
    /// Smallest dihedral angle over all elements [degrees].
    pub min_dihedral_deg: f64,
    /// Median over elements of each element's smallest dihedral angle [degrees].
    pub median_min_dihedral_deg: f64,
    /// Largest dihedral angle over all elements [degrees].
    pub max_dihedral_deg: f64,
    /// Median edge length [m].
    pub median_edge: f64,
    /// Elements with signed volume at or below 0.
    pub inverted: usize,
    /// Volume [m3].
    pub volume: f64,
}

impl TetQuality {
    /// Measures `mesh`; all zero for an empty one.
    pub fn of(mesh: &TetMesh) -> Self {
        if mesh.tets.is_empty() {
            return Self::default();
        }
        let mut smallest = Vec::with_capacity(mesh.tets.len());
        let mut largest: f64 = 0.0;
        for t in 0..mesh.tets.len() {
            let angles = dihedral_angles(mesh.corners(t));
            smallest.push(angles.into_iter().fold(f64::INFINITY, f64::min).to_degrees());
            largest = largest.max(angles.into_iter().fold(0.0, f64::max).to_degrees());
        }
        let length = |[i, j]: [u32; 2]| (mesh.vertices[i as usize] - mesh.vertices[j as usize]).length();
        let mut lengths: Vec<f64> = mesh.edges().into_iter().map(length).collect();
        Self {
            min_dihedral_deg: smallest.iter().copied().fold(f64::INFINITY, f64::min),
            median_min_dihedral_deg: median(&mut smallest),
            max_dihedral_deg: largest,
            median_edge: median(&mut lengths),
            inverted: mesh.inverted(),
            volume: mesh.volume(),
        }
    }
}

/// The six dihedral angles of a tetrahedron [rad].
fn dihedral_angles(x: [DVec3; 4]) -> [f64; 6] {
    EDGES.map(|[i, j]| {
        let [k, l] = match (i, j) {
            (0, 1) => [2, 3],
            (0, 2) => [1, 3],
            (0, 3) => [1, 2],
            (1, 2) => [0, 3],
            (1, 3) => [0, 2],
            _ => [0, 1],
        };
        // Angle between the two faces at the edge, from their normals.
        let edge = x[j] - x[i];
        let (m, n) = (edge.cross(x[k] - x[i]), edge.cross(x[l] - x[i]));
        m.cross(n).length().atan2(m.dot(n))
    })
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
