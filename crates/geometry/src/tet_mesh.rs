//! Tetrahedral bodies.

use crate::{TriMesh, tri_mesh};
use glam::DVec3;

/// A tetrahedral mesh. Every element (a, b, c, d) has positive signed volume (b-a)x(c-a).(d-a)/6.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Node positions [m].
    pub vertices: Vec<DVec3>,
    /// Node indices of each element.
    pub tets: Vec<[u32; 4]>,
}

/// Faces of an element, outward, as corner numbers; face k is opposite corner k.
pub(crate) const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Edges of an element as corner numbers.
pub(crate) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl TetMesh {
    /// Corner positions of element `t` [m].
    pub fn corners(&self, t: usize) -> [DVec3; 4] {
        self.tets[t].map(|i| self.vertices[i as usize])
    }

    /// Signed volume of element `t` [m3].
    pub fn tet_volume(&self, t: usize) -> f64 {
        let [a, b, c, d] = self.corners(t);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Sum of the signed volumes [m3].
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|t| self.tet_volume(t)).sum()
    }

    /// Number of elements with signed volume at or below 0.
    pub fn inverted(&self) -> usize {
        (0..self.tets.len()).filter(|t| self.tet_volume(*t) <= 0.0).count()
    }

    /// Smallest and largest coordinates [m]; `None` without nodes.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        tri_mesh::bounds(&self.vertices)
    }

    /// Every edge once, lower node first, ascending.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> =
            self.tets.iter().flat_map(|t| EDGES.map(|[i, j]| [t[i].min(t[j]), t[i].max(t[j])])).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// Outward-facing boundary surface and, for each of its vertices, the node it is.
    pub fn boundary(&self) -> (TriMesh, Vec<u32>) {
        let (surface, nodes, _) = self.boundary_of(|_| true);
        (surface, nodes)
    }

    /// Boundary of the elements whose middle lies on the side of the plane through `point` that `normal` points away from, and for each
    /// triangle whether it is a cut face (an inner face of the whole body): for pictures of the inside.
    pub fn cut_away(&self, point: DVec3, normal: DVec3) -> (TriMesh, Vec<bool>) {
        let middle = |t: usize| self.corners(t).iter().sum::<DVec3>() / 4.0;
        let (surface, _, inner) = self.boundary_of(|t| (middle(t) - point).dot(normal) < 0.0);
        (surface, inner)
    }

    /// Boundary of some elements: surface, node of each vertex, and whether each triangle is an inner face of the whole body.
    fn boundary_of(&self, chosen: impl Fn(usize) -> bool) -> (TriMesh, Vec<u32>, Vec<bool>) {
        let faces = self.faces();
        let mut mesh = TriMesh::default();
        let (mut nodes, mut inner) = (Vec::new(), Vec::new());
        let mut index = vec![u32::MAX; self.vertices.len()];
        for run in faces.chunk_by(|a, b| a.key == b.key) {
            let mut kept = run.iter().filter(|f| chosen(f.tet as usize));
            let (Some(face), None) = (kept.next(), kept.next()) else { continue };
            mesh.triangles.push(FACES[face.opposite as usize].map(|k| {
                let node = self.tets[face.tet as usize][k];
                if index[node as usize] == u32::MAX {
                    index[node as usize] = nodes.len() as u32;
                    nodes.push(node);
                    mesh.vertices.push(self.vertices[node as usize]);
                }
                index[node as usize]
            }));
            inner.push(run.len() > 1);
        }
        (mesh, nodes, inner)
    }

    /// Every face of every element, sorted so that the two sides of an inner face are neighbours.
    fn faces(&self) -> Vec<Face> {
        let mut faces = Vec::with_capacity(4 * self.tets.len());
        for (t, tet) in self.tets.iter().enumerate() {
            for (k, corners) in FACES.iter().enumerate() {
                let mut key = corners.map(|c| tet[c]);
                key.sort_unstable();
                faces.push(Face { key, tet: t as u32, opposite: k as u8 });
            }
        }
        faces.sort_unstable();
        faces
    }

    /// The largest part (by volume) whose elements are joined by faces, without unused nodes. The order of elements and nodes is kept.
    pub fn largest_component(&self) -> Self {
        let mut parent: Vec<u32> = (0..self.tets.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for run in self.faces().chunk_by(|a, b| a.key == b.key) {
            for other in &run[1..] {
                let (a, b) = (root(&mut parent, run[0].tet), root(&mut parent, other.tet));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut volume = vec![0.0; self.tets.len()];
        for t in 0..self.tets.len() {
            volume[root(&mut parent, t as u32) as usize] += self.tet_volume(t);
        }
        let mut best = 0;
        for k in 0..volume.len() {
            if volume[k] > volume[best] {
                best = k;
            }
        }
        let tets: Vec<[u32; 4]> = (0..self.tets.len())
            .filter(|t| root(&mut parent, *t as u32) as usize == best)
            .map(|t| self.tets[t])
            .collect();
        let mut used = vec![false; self.vertices.len()];
        tets.iter().flatten().for_each(|i| used[*i as usize] = true);
        let mut index = vec![0u32; self.vertices.len()];
        let mut out = Self::default();
        for (i, v) in self.vertices.iter().enumerate().filter(|(i, _)| used[*i]) {
            index[i] = out.vertices.len() as u32;
            out.vertices.push(*v);
        }
        out.tets = tets.into_iter().map(|t| t.map(|i| index[i as usize])).collect();
        out
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    /// Nodes, ascending.
    key: [u32; 3],
    tet: u32,
    /// Corner of the element that is not on the face.
    opposite: u8,
}
