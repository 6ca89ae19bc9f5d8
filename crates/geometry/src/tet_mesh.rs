//! Tetrahedral meshes.

pub(crate) mod adjacency;

use crate::TriMesh;
use adjacency::{EDGES, FACES, NO_TET, face_neighbours};
use glam::DVec3;
use rayon::prelude::*;

/// A tetrahedral mesh. The signed volume (b-a)x(c-a).(d-a)/6 of every element `[a, b, c, d]` is
/// positive.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::TetMesh;
///
/// let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh = TetMesh { vertices, tets: vec![[0, 1, 2, 3]] };
/// assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-15);
/// let (surface, nodes) = mesh.boundary();
/// assert!(surface.is_watertight() && nodes.len() == 4);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Node positions (m).
    pub vertices: Vec<DVec3>,
    /// Node indices of each element.
    pub tets: Vec<[u32; 4]>,
}

/// The surface of a body after part of it is cut away, see [`TetMesh::cut_away`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CutAway {
    /// Outward-facing surface of the remaining elements.
    pub surface: TriMesh,
    /// For each vertex of `surface`, its node.
    pub nodes: Vec<u32>,
    /// For each triangle of `surface`, its element.
    pub tets: Vec<u32>,
    /// For each triangle of `surface`, whether the cut exposed it (it was inside the body).
    pub bared: Vec<bool>,
}

impl TetMesh {
    /// Positions of the four corners of element `t` (m).
    pub fn corners(&self, t: usize) -> [DVec3; 4] {
        self.tets[t].map(|node| self.vertices[node as usize])
    }

    /// Signed volume of element `t` (m3).
    pub fn tet_volume(&self, t: usize) -> f64 {
        let [a, b, c, d] = self.corners(t);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Sum of the signed volumes (m3).
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|t| self.tet_volume(t)).sum()
    }

    /// Number of elements whose signed volume is not positive (or NaN).
    pub fn inverted(&self) -> usize {
        (0..self.tets.len()).filter(|&t| !matches!(self.tet_volume(t), v if v > 0.0)).count()
    }

    /// For each element and each of its corners, the element across the opposite face; `None` on
    /// the boundary. A face of three or more elements, which no conforming mesh has, counts as
    /// boundary of each.
    pub fn neighbours(&self) -> Vec<[Option<u32>; 4]> {
        let across = |t: u32| (t != NO_TET).then_some(t);
        face_neighbours(&self.tets).into_iter().map(|faces| faces.map(across)).collect()
    }

    /// The outward-facing boundary surface and the node of each of its vertices. Triangles have the
    /// order of their elements, vertices the order of the nodes.
    pub fn boundary(&self) -> (TriMesh, Vec<u32>) {
        let (faces, _) = self.open_faces(&face_neighbours(&self.tets), |_| true);
        self.surface_of(faces)
    }

    /// Surface of the elements whose centroid is on the negative side of the plane through `point`
    /// (m) with normal `normal` (any length). Used for cross-sections.
    pub fn cut_away(&self, point: DVec3, normal: DVec3) -> CutAway {
        let neighbours = face_neighbours(&self.tets);
        let keep: Vec<bool> = (0..self.tets.len())
            .map(|t| (self.corners(t).iter().sum::<DVec3>() / 4.0 - point).dot(normal) < 0.0)
            .collect();
        let (faces, owners) = self.open_faces(&neighbours, |t| keep[t]);
        let (surface, nodes) = self.surface_of(faces);
        let bared = owners.iter().map(|&(t, f)| neighbours[t as usize][f] != NO_TET).collect();
        CutAway { surface, nodes, tets: owners.into_iter().map(|(t, _)| t).collect(), bared }
    }

    /// All distinct edges as (smaller node, larger node), sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self
            .tets
            .par_iter()
            .flat_map_iter(|tet| EDGES.iter().map(|&[a, b]| [tet[a].min(tet[b]), tet[a].max(tet[b])]))
            .collect();
        edges.par_sort_unstable();
        edges.dedup();
        edges
    }

    /// Smallest and largest coordinates (m); `None` without nodes.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p))))
    }

    /// Faces between a kept element and no element or one that is not kept, as nodes and as
    /// (element, face).
    fn open_faces(&self, neighbours: &[[u32; 4]], keep: impl Fn(usize) -> bool) -> (Vec<[u32; 3]>, Vec<(u32, usize)>) {
        let mut faces = Vec::new();
        let mut owners = Vec::new();
        for (t, tet) in self.tets.iter().enumerate().filter(|&(t, _)| keep(t)) {
            for (f, corners) in FACES.iter().enumerate() {
                let across = neighbours[t][f];
                if across == NO_TET || !keep(across as usize) {
                    faces.push(corners.map(|corner| tet[corner]));
                    owners.push((t as u32, f));
                }
            }
        }
        (faces, owners)
    }

    /// A surface with its own vertices from triangles over the nodes, and the node of each vertex.
    fn surface_of(&self, mut triangles: Vec<[u32; 3]>) -> (TriMesh, Vec<u32>) {
        let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut vertex_of = vec![0; self.vertices.len()];
        for (vertex, &node) in nodes.iter().enumerate() {
            vertex_of[node as usize] = vertex as u32;
        }
        for corner in triangles.iter_mut().flatten() {
            *corner = vertex_of[*corner as usize];
        }
        let vertices = nodes.iter().map(|&node| self.vertices[node as usize]).collect();
        (TriMesh { vertices, triangles, colors: Vec::new() }, nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of edge 2 split into the six tets around its main diagonal.
    fn cube() -> TetMesh {
        let vertices = (0..8).map(|i| 2.0 * DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64)).collect();
        let tets = vec![[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        TetMesh { vertices, tets }
    }

    fn surface_volume(surface: &TriMesh) -> f64 {
        let v = |i: u32| surface.vertices[i as usize];
        surface.triangles.iter().map(|t| v(t[0]).dot(v(t[1]).cross(v(t[2]))) / 6.0).sum()
    }

    #[test]
    fn a_cube_has_its_volume_edges_and_boundary() {
        let mesh = cube();
        assert!((mesh.volume() - 8.0).abs() < 1e-12);
        assert_eq!(mesh.inverted(), 0);
        assert_eq!(mesh.edges().len(), 12 + 6 + 1);
        assert_eq!(mesh.edges()[0], [0, 1]);
        assert_eq!(mesh.bounds(), Some((DVec3::ZERO, DVec3::splat(2.0))));
        let (surface, nodes) = mesh.boundary();
        assert_eq!((surface.triangles.len(), nodes), (12, (0..8).collect()));
        // The six tets form a ring around the diagonal.
        assert_eq!(mesh.neighbours()[0], [None, Some(1), Some(5), None]);
        assert!((surface_volume(&surface) - 8.0).abs() < 1e-12, "triangles must face outward");
    }

    #[test]
    fn swapping_two_corners_inverts_an_element() {
        let mut mesh = cube();
        mesh.tets[2].swap(0, 1);
        assert_eq!(mesh.inverted(), 1);
        mesh.vertices[7].x = f64::NAN;
        assert_eq!(mesh.inverted(), 6);
    }

    #[test]
    fn cutting_away_exposes_the_inside() {
        let mesh = cube();
        // Keeps the three tets with x > y on average: one half of the cube, cut along the diagonal
        // plane x = y.
        let half = mesh.cut_away(DVec3::ZERO, DVec3::new(-1.0, 1.0, 0.0));
        assert_eq!(half.bared.iter().filter(|&&b| b).count(), 2);
        assert_eq!(half.surface.triangles.len(), 8);
        assert!((surface_volume(&half.surface) - 4.0).abs() < 1e-12);
        assert!(half.tets.iter().all(|&t| [0, 4, 5].contains(&t)));
        assert_eq!(half.nodes.len(), half.surface.vertices.len());
        assert!(mesh.cut_away(DVec3::splat(-1.0), DVec3::ONE).surface.triangles.is_empty());
    }
}
