//! Elements as sample points: linear and quadratic tetrahedra, and patches of linear ones.

use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::TetMesh;
use trocar_tissue::Material;
use trocar_tissue::assembly::shape_gradients;

/// Barycentric coordinates of the four points that integrate quadratic functions over a
/// tetrahedron exactly (Hammer and Stroud 1956): one at this corner, the others share the rest.
const GAUSS: f64 = 0.585_410_196_624_968_5;

/// Edges of a tetrahedron by corners; a quadratic one has a node at the middle of each.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// A point at which the energy density is taken.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub nodes: Vec<u32>,
    /// F = sum x_i m_i' (1/m).
    pub gradients: Vec<DVec3>,
    /// (m3)
    pub volume: f64,
    /// Index of the material.
    pub material: usize,
}

/// A body divided into elements.
#[derive(Clone, Debug)]
pub struct Elements {
    /// Nodes at rest (m): those of the mesh, then those of the edges of quadratic elements.
    pub(super) rest: Vec<DVec3>,
    /// The tetrahedra.
    mesh: TetMesh,
    /// The node at the middle of each edge of the body's mesh (smaller node, larger node), if the
    /// elements have such nodes.
    middles: BTreeMap<[u32; 2], u32>,
    /// Whether the nodes at the middles are of the tetrahedra themselves: quadratic ones.
    quadratic: bool,
    pub(super) samples: Vec<Sample>,
    pub(super) materials: Vec<Material>,
}

/// A point of a body: a weighted sum of nodes.
#[derive(Clone, Debug)]
pub struct Place {
    pub(super) nodes: Vec<(u32, f64)>,
}

impl Place {
    /// The weighted sum of a field over the nodes.
    pub fn of(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().map(|(i, weight)| *weight * field[*i as usize]).sum()
    }
}

impl Elements {
    /// Linear tetrahedra.
    pub fn linear(mesh: &TetMesh, material: Material) -> Self {
        let sample = |t: usize| linear_sample(mesh, t, 0);
        let samples = (0..mesh.tets.len()).map(sample).collect();
        Self::of(mesh, BTreeMap::new(), samples, vec![material])
    }

    /// Linear tetrahedra of half the size: each of the mesh's divided into eight.
    pub fn divided(mesh: &TetMesh, material: Material) -> Self {
        let middles = middles(mesh);
        let mut fine = TetMesh { vertices: nodes_with(mesh, &middles), tets: Vec::with_capacity(8 * mesh.tets.len()) };
        for tet in &mesh.tets {
            let [a, b, c, d] = *tet;
            let middle = |a: u32, b: u32| middles.get(&sorted(a, b)).copied().unwrap_or(a);
            let [ab, ac, ad] = [middle(a, b), middle(a, c), middle(a, d)];
            let [bc, bd, cd] = [middle(b, c), middle(b, d), middle(c, d)];
            // Four at the corners, four around the diagonal between the middles of two edges.
            let corners = [[a, ab, ac, ad], [ab, b, bc, bd], [ac, bc, c, cd], [ad, bd, cd, d]];
            let inner = [[ab, cd, ac, ad], [ab, cd, ad, bd], [ab, cd, bd, bc], [ab, cd, bc, ac]];
            for mut tet in corners.into_iter().chain(inner) {
                let [a, b, c, d] = tet.map(|i| fine.vertices[i as usize]);
                if (b - a).cross(c - a).dot(d - a) < 0.0 {
                    tet.swap(2, 3);
                }
                fine.tets.push(tet);
            }
        }
        let samples = (0..fine.tets.len()).map(|t| linear_sample(&fine, t, 0)).collect();
        Self { middles, ..Self::of(&fine, BTreeMap::new(), samples, vec![material]) }
    }

    /// Quadratic tetrahedra with straight edges: the same body, with a node at the middle of each
    /// edge, integrated at four points each.
    pub fn quadratic(mesh: &TetMesh, material: Material) -> Self {
        let middles = middles(mesh);
        let mut samples = Vec::with_capacity(4 * mesh.tets.len());
        for (t, tet) in mesh.tets.iter().enumerate() {
            let linear = shape_gradients(mesh, t);
            let edge = |[a, b]: [usize; 2]| middles.get(&sorted(tet[a], tet[b])).copied();
            let nodes: Vec<u32> = tet.iter().copied().chain(EDGES.iter().filter_map(|e| edge(*e))).collect();
            for point in 0..4 {
                let at: [f64; 4] = std::array::from_fn(|c| if c == point { GAUSS } else { (1.0 - GAUSS) / 3.0 });
                // Corners L (2 L - 1), edges 4 L L'.
                let corners = (0..4).map(|c| (4.0 * at[c] - 1.0) * linear[c]);
                let edges = EDGES.iter().map(|[a, b]| 4.0 * (at[*a] * linear[*b] + at[*b] * linear[*a]));
                let gradients = corners.chain(edges).collect();
                samples.push(Sample {
                    nodes: nodes.clone(),
                    gradients,
                    volume: 0.25 * mesh.tet_volume(t),
                    material: 0,
                });
            }
        }
        Self::of(mesh, middles, samples, vec![material])
    }

    pub(super) fn of(
        mesh: &TetMesh,
        middles: BTreeMap<[u32; 2], u32>,
        samples: Vec<Sample>,
        materials: Vec<Material>,
    ) -> Self {
        let quadratic = !middles.is_empty();
        Self { rest: nodes_with(mesh, &middles), mesh: mesh.clone(), middles, quadratic, samples, materials }
    }

    /// The tetrahedra; of quadratic elements, by their corners.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// Nodes at rest (m).
    pub fn rest(&self) -> &[DVec3] {
        &self.rest
    }

    /// Marks the nodes of everything that corners hold: those corners themselves, and the middles
    /// of edges between two of them.
    pub fn held_by(&self, corner: impl Fn(DVec3) -> bool) -> Vec<bool> {
        let corners = self.rest.len() - self.middles.len();
        let mut held: Vec<bool> = self.rest[..corners].iter().map(|p| corner(*p)).collect();
        held.resize(self.rest.len(), false);
        for ([a, b], middle) in &self.middles {
            held[*middle as usize] = held[*a as usize] && held[*b as usize];
        }
        held
    }

    /// The place of a point (m), in the element that it lies in or lies the least outside of.
    pub fn locate(&self, p: DVec3) -> Place {
        let mut best = (f64::NEG_INFINITY, 0, [0.0; 4]);
        for t in 0..self.mesh.tets.len() {
            let corners = self.mesh.corners(t);
            // A tetrahedron farther away than its own size cannot have it.
            let size = corners[1..].iter().map(|q| q.distance_squared(corners[0])).fold(0.0, f64::max);
            if p.distance_squared(corners[0]) > 4.0 * size {
                continue;
            }
            let gradients = shape_gradients(&self.mesh, t);
            let at: [f64; 4] = std::array::from_fn(|c| 0.25 + gradients[c].dot(p - centre(&corners)));
            let least = at.iter().copied().fold(f64::INFINITY, f64::min);
            if least > best.0 {
                best = (least, t, at);
            }
        }
        let (_, t, at) = best;
        let tet = self.mesh.tets[t];
        if !self.quadratic {
            return Place { nodes: tet.into_iter().zip(at).collect() };
        }
        let corners = (0..4).map(|c| (tet[c], at[c] * (2.0 * at[c] - 1.0)));
        let edges = EDGES.iter().filter_map(|[a, b]| {
            let node = self.middles.get(&sorted(tet[*a], tet[*b]))?;
            Some((*node, 4.0 * at[*a] * at[*b]))
        });
        Place { nodes: corners.chain(edges).collect() }
    }

    /// Each node's part of a load of 1 per volume (m3): its shape function, integrated.
    pub fn shares(&self) -> Vec<f64> {
        let mut shares = vec![0.0; self.rest.len()];
        for (t, tet) in self.mesh.tets.iter().enumerate() {
            let volume = self.mesh.tet_volume(t);
            if !self.quadratic {
                tet.iter().for_each(|i| shares[*i as usize] += 0.25 * volume);
                continue;
            }
            tet.iter().for_each(|i| shares[*i as usize] -= 0.05 * volume);
            for [a, b] in EDGES {
                if let Some(node) = self.middles.get(&sorted(tet[a], tet[b])) {
                    shares[*node as usize] += 0.2 * volume;
                }
            }
        }
        shares
    }
}

pub(super) fn linear_sample(mesh: &TetMesh, t: usize, material: usize) -> Sample {
    let gradients = shape_gradients(mesh, t).to_vec();
    Sample { nodes: mesh.tets[t].to_vec(), gradients, volume: mesh.tet_volume(t), material }
}

/// A node for the middle of each edge, after the mesh's own.
fn middles(mesh: &TetMesh) -> BTreeMap<[u32; 2], u32> {
    let first = mesh.vertices.len() as u32;
    mesh.edges().into_iter().zip(first..).collect()
}

/// The mesh's nodes and those of the edges' middles (m).
fn nodes_with(mesh: &TetMesh, middles: &BTreeMap<[u32; 2], u32>) -> Vec<DVec3> {
    let mut nodes = mesh.vertices.clone();
    nodes.resize(mesh.vertices.len() + middles.len(), DVec3::ZERO);
    for ([a, b], middle) in middles {
        nodes[*middle as usize] = 0.5 * (mesh.vertices[*a as usize] + mesh.vertices[*b as usize]);
    }
    nodes
}

fn centre(corners: &[DVec3; 4]) -> DVec3 {
    corners.iter().sum::<DVec3>() / 4.0
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
