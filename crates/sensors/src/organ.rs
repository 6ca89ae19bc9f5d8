//! Drawn surface of an organ: the recorded skin moves with the body; a cut adds the faces that it
//! exposes.

use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::{Skin, TetMesh, TriMesh};
use trocar_specimen::Organ;

/// Colour of the faces that a cut exposes.
pub(crate) const EXPOSED: [u8; 3] = [158, 34, 40];

/// Corners of the face opposite each corner of an element, counter-clockwise seen from outside.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// An organ and its skin in the rest pose.
#[derive(Clone, Debug)]
pub(crate) struct OrganSkin {
    pub name: String,
    pub surface: TriMesh,
    pub body: TetMesh,
    skin: Skin,
    nodes: BTreeMap<[u64; 3], u32>,
    elements: BTreeMap<[u32; 4], u32>,
}

/// A surface whose vertices are weighted sums of nodes. Nodes of all pieces are numbered
/// consecutively.
#[derive(Clone, Debug, Default)]
pub struct BoundSurface {
    /// Rest pose, with colours.
    pub mesh: TriMesh,
    weights: Vec<([u32; 4], [f64; 4])>,
}

/// A piece of an organ: rest positions of its nodes, and its elements.
pub(crate) struct Piece<'a> {
    pub rest: &'a [DVec3],
    pub tets: &'a [[u32; 4]],
}

fn bits(p: &DVec3) -> [u64; 3] {
    p.to_array().map(f64::to_bits)
}

fn sorted<const N: usize>(mut nodes: [u32; N]) -> [u32; N] {
    nodes.sort_unstable();
    nodes
}

impl OrganSkin {
    pub fn new(organ: &Organ) -> Self {
        let mut surface = organ.surface.clone();
        if surface.colors.len() != surface.vertices.len() {
            surface.colors = vec![[190, 96, 88]; surface.vertices.len()];
        }
        let numbered = |i: usize| i as u32;
        Self {
            name: organ.name.clone(),
            skin: Skin::bind(&surface, &organ.body),
            surface,
            nodes: organ.body.vertices.iter().enumerate().map(|(i, p)| (bits(p), numbered(i))).collect(),
            elements: organ.body.tets.iter().enumerate().map(|(i, t)| (sorted(*t), numbered(i))).collect(),
            body: organ.body.clone(),
        }
    }

    /// Surface of the organ in one piece.
    pub fn whole_surface(&self) -> BoundSurface {
        let weights = self.skin.bindings.iter().map(|(t, w)| (self.body.tets[*t as usize], *w)).collect();
        BoundSurface { mesh: self.surface.clone(), weights }
    }

    /// Surface of the organ in `pieces`; `None` if they are not pieces of this organ. The recorded
    /// skin has no cut. The faces of the elements replace it at elements that were separated and
    /// beside them.
    pub fn surface_of_pieces(&self, pieces: &[Piece<'_>]) -> Option<BoundSurface> {
        let mut tets = vec![[u32::MAX; 4]; self.body.tets.len()];
        let mut piece_of = vec![0_usize; tets.len()];
        let mut parents = Vec::new();
        for (k, piece) in pieces.iter().enumerate() {
            let first = parents.len() as u32;
            for p in piece.rest {
                parents.push(*self.nodes.get(&bits(p))?);
            }
            for tet in piece.tets {
                let whole = tet.map(|i| parents.get((first + i) as usize).copied().unwrap_or(u32::MAX));
                let element = *self.elements.get(&sorted(whole))? as usize;
                // Corners in the order of the specimen, which the skin's weights use.
                tets[element] =
                    self.body.tets[element].map(|node| first + tet[whole.iter().position(|w| *w == node).unwrap_or(0)]);
                piece_of[element] = k;
            }
        }
        if tets.iter().any(|t| t[0] == u32::MAX) {
            return None;
        }
        let mut copies = vec![0_u32; self.body.vertices.len()];
        parents.iter().for_each(|i| copies[*i as usize] += 1);
        let beside = |nodes: &dyn Fn(u32) -> bool| -> Vec<bool> {
            self.body.tets.iter().map(|tet| tet.iter().any(|i| nodes(*i))).collect()
        };
        // Separated elements and those that share a node with them: skin and faces overlap there,
        // so that no gap shows.
        let at_cut = beside(&|i| copies[i as usize] > 1);
        let mut near = vec![false; copies.len()];
        for (tet, _) in self.body.tets.iter().zip(&at_cut).filter(|(_, at)| **at) {
            tet.iter().for_each(|i| near[*i as usize] = true);
        }
        let around = beside(&|i| near[i as usize]);
        let stays = |triangle: &&[u32; 3]| {
            let of = triangle.map(|v| self.skin.bindings[v as usize].0 as usize);
            of.iter().all(|t| !at_cut[*t] && piece_of[*t] == piece_of[of[0]])
        };
        let mut bound = BoundSurface {
            mesh: TriMesh {
                triangles: self.surface.triangles.iter().filter(stays).copied().collect(),
                ..self.surface.clone()
            },
            weights: self.skin.bindings.iter().map(|(t, w)| (tets[*t as usize], *w)).collect(),
        };
        let neighbours = |tets: &[[u32; 4]]| TetMesh { vertices: Vec::new(), tets: tets.to_vec() }.neighbours();
        let (before, after) = (neighbours(&self.body.tets), neighbours(&tets));
        let (mut outer, mut exposed) = (Vec::new(), Vec::new());
        for (t, tet) in tets.iter().enumerate() {
            for (corner, face) in FACES.iter().enumerate() {
                let nodes = face.map(|c| tet[c]);
                match (before[t][corner], after[t][corner]) {
                    (None, _) if around[t] => outer.push(nodes),
                    (Some(_), None) => exposed.push(nodes),
                    _ => {}
                }
            }
        }
        let tint = |node: u32| {
            let p = self.body.vertices[parents[node as usize] as usize];
            let nearest = self.surface.vertices.iter().zip(&self.surface.colors);
            nearest
                .min_by(|a, b| a.0.distance_squared(p).total_cmp(&b.0.distance_squared(p)))
                .map_or(EXPOSED, |(_, c)| *c)
        };
        let place = |node: u32| self.body.vertices[parents[node as usize] as usize];
        bound.add(&outer, &place, &tint);
        bound.add(&exposed, &place, &|_| EXPOSED);
        Some(bound)
    }
}

impl BoundSurface {
    /// A mesh whose vertices are placed without nodes.
    pub fn alone(mesh: TriMesh) -> Self {
        Self { mesh, weights: Vec::new() }
    }

    /// Adds faces between nodes with new vertices, so that their colours do not blend with adjacent
    /// faces.
    fn add(&mut self, faces: &[[u32; 3]], place: &dyn Fn(u32) -> DVec3, color: &dyn Fn(u32) -> [u8; 3]) {
        let mut number = BTreeMap::new();
        for node in faces.iter().flatten() {
            number.entry(*node).or_insert_with(|| {
                self.mesh.vertices.push(place(*node));
                self.mesh.colors.push(color(*node));
                self.weights.push(([*node; 4], [1.0, 0.0, 0.0, 0.0]));
                self.mesh.vertices.len() as u32 - 1
            });
        }
        self.mesh.triangles.extend(faces.iter().map(|f| f.map(|node| number[&node])));
    }

    /// Values at the vertices for the values `nodes` at the nodes.
    pub fn values(&self, nodes: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.extend(self.weights.iter().map(|(tet, w)| {
            let [a, b, c, d] = tet.map(|i| nodes[i as usize]);
            w[0] as f32 * a + w[1] as f32 * b + w[2] as f32 * c + w[3] as f32 * d
        }));
    }

    /// Vertex positions for the node positions `nodes` (m). Reuses the memory of `out`.
    pub fn positions(&self, nodes: &[DVec3], out: &mut Vec<DVec3>) {
        out.clear();
        out.extend(self.weights.iter().map(|(tet, w)| {
            let [a, b, c, d] = tet.map(|i| nodes[i as usize]);
            w[0] * a + w[1] * b + w[2] * c + w[3] * d
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_specimen::{Material, OrganFacts, Pins};
    use trocar_tissue::{BodyDescription, ConstitutiveModel, Cut, ModelBuilder, State, sever};

    /// A row of cubes of 4 mm along x, six elements each.
    fn row(cubes: u32) -> TetMesh {
        let mut mesh = TetMesh::default();
        for i in 0..=cubes {
            for c in 0..4 {
                mesh.vertices.push(4e-3 * DVec3::new(f64::from(i), f64::from(c & 1), f64::from(c >> 1)));
            }
        }
        for i in 0..cubes {
            let corner = |c: u32| 4 * (i + (c & 1)) + (c >> 1);
            for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
            }
        }
        mesh
    }

    #[test]
    fn pieces_separate_with_their_exposed_faces() {
        let body = row(12);
        let (mut surface, _) = body.boundary();
        surface.colors = vec![[200, 120, 90]; surface.vertices.len()];
        let volume = surface.volume();
        let organ = Organ {
            name: "row".to_owned(),
            base: body.vertices[0],
            body: body.clone(),
            surface,
            material: Material::default(),
            pins: Pins::None,
            threads: None,
            posterior: None,
            facts: OrganFacts::default(),
        };
        let whole = OrganSkin::new(&organ);
        let mut builder = ModelBuilder::new();
        let material = trocar_tissue::Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let description =
            BodyDescription { name: "row".into(), mesh: &body, material, pinned: vec![0, 1], supports: vec![] };
        builder.body(description).unwrap();
        let model = builder.build().unwrap();
        let point = DVec3::new(0.0241, 2e-3, 2e-3);
        let cut = sever(&model, &State::new(&model), &Cut::through(0, point, DVec3::X)).unwrap();
        assert_eq!(cut.pieces.len(), 2);
        let bodies = cut.model.bodies();
        let pieces: Vec<Piece<'_>> =
            bodies.iter().map(|b| Piece { rest: b.rest_positions(), tets: b.tets() }).collect();
        let surface = whole.surface_of_pieces(&pieces).unwrap();
        let mut nodes = Vec::new();
        for (k, body) in bodies.iter().enumerate() {
            nodes.extend(body.rest_positions().iter().map(|p| *p + DVec3::X * 0.05 * k as f64));
        }
        let mut moved = surface.mesh.clone();
        surface.positions(&nodes, &mut moved.vertices);
        // The cut exposes a cross-section of 4 x 4 mm on each side, facing each other. Skin and
        // faces overlap beside it, so volumes cannot be compared.
        let exposed = (0..moved.triangles.len())
            .filter(|t| moved.triangles[*t].iter().all(|v| moved.colors[*v as usize] == EXPOSED))
            .map(|t| moved.area_vector(t));
        let (mut there, mut back) = (0.0, 0.0);
        for area in exposed {
            there += area.x.max(0.0);
            back -= area.x.min(0.0);
        }
        assert!((there - 1.6e-5).abs() < 1e-9 && (back - 1.6e-5).abs() < 1e-9, "{there} {back}");
        assert!(volume > 0.0 && moved.volume() >= volume);
        assert!(moved.colors.contains(&EXPOSED) && moved.colors.len() == moved.vertices.len());
        // No triangle spans the gap.
        let longest = (0..moved.triangles.len()).map(|t| {
            let [a, b, c] = moved.corners(t);
            a.distance(b).max(b.distance(c)).max(c.distance(a))
        });
        assert!(longest.fold(0.0, f64::max) < 0.01);
        // Pieces of another organ are rejected.
        let other = [DVec3::ZERO; 4];
        assert!(whole.surface_of_pieces(&[Piece { rest: &other, tets: &[[0, 1, 2, 3]] }]).is_none());
    }
}
