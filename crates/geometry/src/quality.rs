//! Element quality of tetrahedral meshes.

use crate::TetMesh;
use crate::tet_mesh::adjacency::EDGES;
use glam::DVec3;
use rayon::prelude::*;

/// Element quality of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TetQuality {
    /// Smallest dihedral angle over all elements (degrees).
    pub min_dihedral_deg: f64,
    /// Median over elements of each element's smallest dihedral angle (degrees).
    pub median_min_dihedral_deg: f64,
    /// Largest dihedral angle over all elements (degrees).
    pub max_dihedral_deg: f64,
    /// Largest ratio of an element's circumradius to its shortest edge; infinite for a flat
    /// element.
    pub max_radius_edge: f64,
    /// Median edge length (m).
    pub median_edge: f64,
    /// 95th percentile of the edge lengths (m).
    pub p95_edge: f64,
    /// Number of elements with signed volume at or below 0.
    pub inverted: usize,
    /// Volume (m3).
    pub volume: f64,
}

impl TetQuality {
    /// Measures `mesh`. All values are zero for an empty mesh.
    pub fn of(mesh: &TetMesh) -> Self {
        if mesh.tets.is_empty() {
            return Self::default();
        }
        let angles: Vec<[f64; 6]> =
            (0..mesh.tets.len()).into_par_iter().map(|t| dihedral_angles(&mesh.corners(t))).collect();
        let smallest: Vec<f64> = angles.iter().map(|six| six.iter().copied().fold(f64::INFINITY, f64::min)).collect();
        let mut lengths: Vec<f64> =
            mesh.edges().iter().map(|&[a, b]| mesh.vertices[a as usize].distance(mesh.vertices[b as usize])).collect();
        let rank = lengths.len() * 95 / 100;
        let p95_edge = *lengths.select_nth_unstable_by(rank, f64::total_cmp).1;
        let ratios: Vec<f64> = (0..mesh.tets.len()).into_par_iter().map(|t| radius_edge(&mesh.corners(t))).collect();
        Self {
            min_dihedral_deg: smallest.iter().copied().fold(f64::INFINITY, f64::min).to_degrees(),
            median_min_dihedral_deg: median(smallest).to_degrees(),
            max_dihedral_deg: angles.iter().flatten().copied().fold(0.0, f64::max).to_degrees(),
            max_radius_edge: ratios.iter().copied().fold(0.0, f64::max),
            median_edge: median(lengths),
            p95_edge,
            inverted: mesh.inverted(),
            volume: mesh.volume(),
        }
    }
}

/// The angles between the two faces at each of the [`EDGES`] (rad), 0..=pi.
pub(crate) fn dihedral_angles(corners: &[DVec3; 4]) -> [f64; 6] {
    EDGES.map(|[i, j]| {
        // k and l are the two corners that are not on the edge. The four indices sum to 6.
        let k = (0..4).find(|&k| k != i && k != j).unwrap_or(0);
        let l = 6 - i - j - k;
        let along = corners[j] - corners[i];
        let m = along.cross(corners[k] - corners[i]);
        let n = along.cross(corners[l] - corners[i]);
        // atan2 keeps full precision near 0 and pi, where the arc cosine loses half of its digits.
        libm::atan2(m.cross(n).length(), m.dot(n))
    })
}

/// Circumradius over shortest edge: sqrt(6) / 4 for a regular tet. The circumcentre c, from one
/// corner, solves u.c = u.u / 2 for the edges u from there.
fn radius_edge(corners: &[DVec3; 4]) -> f64 {
    let [u, v, w] = [1, 2, 3].map(|i| corners[i] - corners[0]);
    let sum = u.length_squared() * v.cross(w) + v.length_squared() * w.cross(u) + w.length_squared() * u.cross(v);
    let radius = sum.length() / (2.0 * u.dot(v.cross(w)).abs());
    let shortest = EDGES.iter().map(|&[i, j]| corners[i].distance_squared(corners[j])).fold(f64::INFINITY, f64::min);
    let ratio = radius / shortest.sqrt();
    if ratio.is_nan() { f64::INFINITY } else { ratio }
}

/// The median; 0 without values.
pub(crate) fn median(values: Vec<f64>) -> f64 {
    trocar_core::median(values).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_and_corner_tets_have_their_known_quality() {
        let regular = TetMesh {
            vertices: vec![
                DVec3::new(1.0, 1.0, 1.0),
                DVec3::new(1.0, -1.0, -1.0),
                DVec3::new(-1.0, 1.0, -1.0),
                DVec3::new(-1.0, -1.0, 1.0),
            ],
            tets: vec![[0, 1, 3, 2]],
        };
        let q = TetQuality::of(&regular);
        let expected = (1.0f64 / 3.0).acos().to_degrees();
        assert!((q.min_dihedral_deg - expected).abs() < 1e-10 && (q.max_dihedral_deg - expected).abs() < 1e-10);
        assert!((q.median_edge - 8f64.sqrt()).abs() < 1e-12);
        assert!((q.volume - 8.0 / 3.0).abs() < 1e-12 && q.inverted == 0);
        assert!((q.max_radius_edge - 6f64.sqrt() / 4.0).abs() < 1e-12 && (q.p95_edge - q.median_edge).abs() < 1e-12);

        let corner = TetMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], tets: vec![[0, 1, 2, 3]] };
        let q = TetQuality::of(&corner);
        assert!((q.max_dihedral_deg - 90.0).abs() < 1e-10);
        assert!((q.min_dihedral_deg - 2f64.sqrt().atan().to_degrees()).abs() < 1e-10);
        assert!((q.median_edge - 0.5 * (1.0 + 2f64.sqrt())).abs() < 1e-12);
        assert!((q.max_radius_edge - 0.75f64.sqrt()).abs() < 1e-12 && (q.p95_edge - 2f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_sliver_has_its_exact_angles_and_an_empty_mesh_has_zeros() {
        // The four points of a square with one pair raised by h. The two flat angles are 2 atan(h)
        // for unit half-diagonals.
        let h = 1e-7;
        let vertices = vec![DVec3::X, -DVec3::X, DVec3::new(0.0, -1.0, h), DVec3::new(0.0, 1.0, h)];
        let q = TetQuality::of(&TetMesh { vertices, tets: vec![[0, 1, 3, 2]] });
        // At the edge (+x, +y) the normals of the two faces differ from +-z by h each, in the same
        // plane.
        assert!(q.min_dihedral_deg > 0.0 && q.min_dihedral_deg < 2e-5, "{}", q.min_dihedral_deg);
        assert!(q.max_dihedral_deg > 179.99998);
        assert_eq!(TetQuality::of(&TetMesh::default()), TetQuality::default());
    }
}
