//! A body's nodes in a lattice: what the lattice solver knows of a body that never changes.

use crate::LatticeSettings;
use glam::{DVec3, Vec3A};
use std::sync::Arc;
use trocar_lattice::{Body as LatticeBody, BodyState as LatticeState, EmbeddedPoint, Motion, RestStiffness};

/// Rounds of the search for a lattice whose nodes are at given places.
const FIT_ROUNDS: usize = 40;

/// The lattice of a body, and where the body's vertices are in it.
///
/// Elements of which all nodes are pinned cannot move and are not part of the lattice: cells at the
/// border of a pinned region are filled with what moves.
#[derive(Clone, Debug)]
pub(crate) struct Embedding(Arc<EmbeddingData>);

/// The data of an [`Embedding`].
#[derive(Clone, Debug)]
pub(crate) struct EmbeddingData {
    pub settings: LatticeSettings,
    /// The body's elements that can move, ascending: those of the lattice.
    pub elements: Vec<u32>,
    pub body: LatticeBody,
    pub rest: RestStiffness,
    /// Point of each vertex (internal order), those of a collision surface after the nodes; None
    /// for vertices that only pinned elements have.
    pub points: Vec<Option<EmbeddedPoint>>,
    /// Number of nodes among the vertices.
    pub nodes: usize,
}

impl std::ops::Deref for Embedding {
    type Target = EmbeddingData;

    fn deref(&self) -> &EmbeddingData {
        &self.0
    }
}

impl Embedding {
    /// Shares the data.
    pub fn new(data: EmbeddingData) -> Self {
        Self(Arc::new(data))
    }

    /// Appends points for the vertices of a collision surface: each with the element of the body
    /// that it moves with, and its place relative to the body's origin (m).
    pub fn embed(&mut self, vertices: impl Iterator<Item = (u32, DVec3)>) {
        let data = Arc::make_mut(&mut self.0);
        let (elements, nodes) = (&data.elements, data.nodes);
        let of: Vec<Option<(u32, DVec3)>> =
            vertices.map(|(element, p)| Some((elements.binary_search(&element).ok()? as u32, p))).collect();
        let moving: Vec<(u32, DVec3)> = of.iter().flatten().copied().collect();
        let mut embedded = data.body.lattice().embed_in(&moving).into_iter();
        data.points.truncate(nodes);
        data.points.extend(of.iter().map(|vertex| vertex.and_then(|_| embedded.next())));
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

    /// Writes positions and velocities of the vertices that the lattice moves. `motion` is scratch.
    pub fn write(&self, lattice: &LatticeState, motion: &mut Motion, x: &mut [Vec3A], v: &mut [Vec3A]) {
        motion.load(lattice);
        motion.write(&self.points, x, v);
    }

    /// Makes the lattice follow vertices that were moved from outside (positions `x`, velocities
    /// `v`): as near to them as it can come. A lattice that the vertices follow keeps every bit.
    pub fn follow(&self, lattice: &mut LatticeState, x: &mut [Vec3A], v: &mut [Vec3A]) {
        self.fit(x, &mut lattice.positions);
        self.fit(v, &mut lattice.velocities);
        self.write(lattice, &mut Motion::default(), x, v);
    }

    /// Fits a field over the lattice to one over the vertices. Every node takes the mean of what
    /// its vertices lack, by their weights, again and again.
    fn fit(&self, wanted: &[Vec3A], field: &mut [DVec3]) {
        let off = |field: &[DVec3]| {
            let points =
                self.points[..self.nodes].iter().zip(wanted).filter_map(|(point, to)| Some((point.as_ref()?, to)));
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
