//! A body's nodes in a lattice: what the lattice solver knows of a body that never changes.

use crate::body::BodyData;
use crate::state::BodyState;
use crate::{LatticeSettings, Result};
use glam::{DVec3, Vec3A};
use std::sync::Arc;
use trocar_geometry::TetMesh;
use trocar_lattice::{
    Body as LatticeBody, BodyDescription, BodyState as LatticeState, EmbeddedPoint, Lattice, LatticeOptions, Material,
    RestStiffness,
};

/// Rounds of the search for a lattice whose nodes are at given places.
const FIT_ROUNDS: usize = 40;

/// The lattice of a body, and where the body's vertices are in it.
///
/// Elements of which all nodes are pinned cannot move and are not part of the lattice: cells at the
/// border of a pinned region are filled with what moves.
#[derive(Clone, Debug)]
pub(crate) struct Embedding(Arc<EmbeddingData>);

/// The data of an [`Embedding`].
#[derive(Debug)]
pub(crate) struct EmbeddingData {
    pub settings: LatticeSettings,
    /// The body's elements that can move, ascending: those of the lattice.
    pub elements: Vec<u32>,
    pub body: LatticeBody,
    pub rest: RestStiffness,
    /// Point of each vertex (internal order); None for vertices that only pinned elements have.
    pub points: Vec<Option<EmbeddedPoint>>,
}

impl std::ops::Deref for Embedding {
    type Target = EmbeddingData;

    fn deref(&self) -> &EmbeddingData {
        &self.0
    }
}

impl Embedding {
    /// Embeds a body. None if all of it is pinned.
    ///
    /// # Errors
    /// A cell out of range, or too many of them.
    pub fn of(body: &BodyData, settings: LatticeSettings) -> Result<Option<Self>> {
        let moves = |tet: &&[u32; 4]| tet.iter().any(|node| !body.pinned[*node as usize]);
        let elements: Vec<u32> =
            (0..body.rest.tets.len() as u32).filter(|t| moves(&&body.rest.tets[*t as usize])).collect();
        if elements.is_empty() {
            return Ok(None);
        }
        let tets: Vec<[u32; 4]> = elements.iter().map(|t| body.rest.tets[*t as usize]).collect();
        let mut nodes: Vec<u32> = tets.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let at = |node: u32| nodes.partition_point(|other| *other < node) as u32;
        let mesh = TetMesh {
            vertices: nodes.iter().map(|node| body.rest.vertices[*node as usize] - body.origin).collect(),
            tets: tets.iter().map(|tet| tet.map(at)).collect(),
        };
        let refused =
            |error: trocar_lattice::Error| crate::Error::Body { body: body.name.clone(), reason: error.to_string() };
        // The pieces of a cut body have the grid of the whole.
        let options = LatticeOptions { origin: Some(DVec3::ZERO), ..LatticeOptions::new(settings.cell) };
        let lattice = Lattice::of_mesh(&mesh, &options).map_err(refused)?;
        let embedded = lattice.embed_nodes().map_err(refused)?;
        let pinned: Vec<u32> = nodes.iter().filter(|node| body.pinned[**node as usize]).map(|node| at(*node)).collect();
        let pins = lattice.embed_held(&pinned).map_err(refused)?;
        let material = Material {
            law: settings.law,
            young_modulus: body.material.young_modulus,
            poisson_ratio: body.material.poisson_ratio,
            density: body.material.density,
        };
        let description = BodyDescription { name: body.name.clone(), lattice, material, pins, fixed: Vec::new() };
        let lattice = LatticeBody::new(description).map_err(refused)?;
        let mut points = vec![None; body.pinned.len()];
        for (node, point) in nodes.iter().zip(embedded) {
            points[body.internal[*node as usize] as usize] = Some(point);
        }
        let rest = lattice.rest_stiffness();
        Ok(Some(Self(Arc::new(EmbeddingData { settings, elements, body: lattice, rest, points }))))
    }

    /// The lattice at rest.
    pub fn at_rest(&self) -> LatticeState {
        LatticeState::new(&self.body)
    }

    /// The state of a piece that was cut off a body: `elements` are the elements of the whole that
    /// its own were. Every node is where the whole's was.
    pub fn of_piece(&self, whole: &Self, state: &LatticeState, elements: &[u32]) -> LatticeState {
        let before = |tet: u32| {
            let element = elements[self.elements[tet as usize] as usize];
            whole.elements.binary_search(&element).ok().map(|tet| tet as u32)
        };
        let mut piece = self.at_rest();
        let nodes = self.body.lattice().nodes_before(whole.body.lattice(), before);
        for (k, node) in nodes.iter().enumerate() {
            if let Some(node) = node {
                piece.positions[k] = state.positions[*node as usize];
                piece.velocities[k] = state.velocities[*node as usize];
            }
        }
        piece
    }

    /// Writes positions and velocities of the vertices that the lattice moves.
    pub fn write(&self, lattice: &LatticeState, x: &mut [Vec3A], v: &mut [Vec3A]) {
        for (i, point) in self.points.iter().enumerate() {
            if let Some(point) = point {
                x[i] = point.interpolate(&lattice.positions).as_vec3a();
                v[i] = point.interpolate(&lattice.velocities).as_vec3a();
            }
        }
    }

    /// Makes the lattice follow vertices that were moved from outside: as near to them as it can
    /// come. A lattice that the vertices follow keeps every bit.
    pub fn follow(&self, state: &mut BodyState) {
        let Some(mut lattice) = state.lattice.take() else { return };
        self.fit(&state.x, &mut lattice.positions);
        self.fit(&state.v, &mut lattice.velocities);
        self.write(&lattice, &mut state.x, &mut state.v);
        state.lattice = Some(lattice);
    }

    /// Fits a field over the lattice to one over the vertices. Every node takes the mean of what
    /// its vertices lack, by their weights, again and again.
    fn fit(&self, wanted: &[Vec3A], field: &mut [DVec3]) {
        let off = |field: &[DVec3]| {
            let points = self.points.iter().zip(wanted).filter_map(|(point, to)| Some((point.as_ref()?, to)));
            points.map(|(point, to)| (*point, *to, point.interpolate(field))).collect::<Vec<_>>()
        };
        if off(field).iter().all(|(_, to, at)| at.as_vec3a() == *to || !to.is_finite()) {
            return;
        }
        for _ in 0..FIT_ROUNDS {
            let mut sums = vec![(DVec3::ZERO, 0.0); field.len()];
            for (point, to, at) in off(field) {
                for (node, weight) in point.nodes.iter().zip(&point.weights) {
                    let sum = &mut sums[*node as usize];
                    sum.0 += weight.max(0.0) * (to.as_dvec3() - at);
                    sum.1 += weight.max(0.0);
                }
            }
            for (place, (sum, weight)) in field.iter_mut().zip(sums) {
                if weight > 0.0 {
                    *place += sum / weight;
                }
            }
        }
    }
}
