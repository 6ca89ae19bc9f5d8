//! Elements that are stretched so far in a frame that the limit of stretch may act on them.
//!
//! They are found at the frame's beginning, with a margin; the sweeps add their part vertex by
//! vertex. Bodies that nothing stretches have none.

use super::kernel::Local;
use crate::Body;
use crate::assembly::shape_gradients;
use crate::material::{MAX_FREE_STRETCH_SQUARED, StretchEnergy};
use glam::{DMat3, DVec3, Mat3A, Vec3A};

/// Elements are kept from this share of the squared stretch on at which the limit acts: a stretch
/// of 2.8 instead of 4.
const MARGIN: f64 = 0.5;

/// Elements are examined that have an edge of more than this many times its rest length.
const MIN_EDGE_STRETCH: f32 = 1.5;

/// The stretched elements of a body.
#[derive(Default)]
pub(crate) struct StretchedElements {
    energy: Option<StretchEnergy>,
    elements: Vec<Element>,
    /// Vertex, element and corner; ascending.
    corners: Vec<(u32, u32, u32)>,
    /// Scratch: whether each vertex has a long edge.
    long: Vec<bool>,
}

struct Element {
    nodes: [u32; 4],
    /// Rest gradients of the shape functions (1/m).
    gradients: [DVec3; 4],
    /// Rest volume (m3).
    volume: f64,
}

impl StretchedElements {
    /// Finds them with the vertices at `x`.
    pub fn find(&mut self, body: &Body, x: &[Vec3A]) {
        self.elements.clear();
        self.corners.clear();
        self.energy = body.material.stretch_energy();
        if self.energy.is_none() {
            return;
        }
        let long = |i: usize| {
            body.edges_of(i)
                .iter()
                .any(|edge| (x[edge.to as usize] - x[i]).length_squared() > (MIN_EDGE_STRETCH * edge.length).powi(2))
        };
        self.long.clear();
        self.long.extend((0..body.len()).map(long));
        if !self.long.contains(&true) {
            return;
        }
        for (t, nodes) in body.tets.iter().enumerate() {
            if nodes.iter().all(|i| !self.long[*i as usize]) {
                continue;
            }
            let element = Element { nodes: *nodes, gradients: shape_gradients(&body.rest, t), volume: body.volumes[t] };
            let square: f64 = element.deformation(x).to_cols_array().iter().map(|e| e * e).sum();
            if square > MARGIN * MAX_FREE_STRETCH_SQUARED {
                let place = self.elements.len() as u32;
                self.corners.extend((0..4).map(|k| (nodes[k as usize], place, k)));
                self.elements.push(element);
            }
        }
        self.corners.sort_unstable();
    }

    /// Whether no element is stretched far.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Whether a vertex has any.
    pub fn any(&self, vertex: usize) -> bool {
        self.of(vertex).next().is_some()
    }

    fn of(&self, vertex: usize) -> impl Iterator<Item = (&Element, usize)> {
        let vertex = vertex as u32;
        let first = self.corners.partition_point(|(i, ..)| *i < vertex);
        let corners = self.corners[first..].iter().take_while(move |(i, ..)| *i == vertex);
        corners.map(|(_, element, corner)| (&self.elements[*element as usize], *corner as usize))
    }

    /// Adds their part of force and block of a vertex, with the vertices at `x`.
    pub fn add(&self, vertex: usize, x: &[Vec3A], local: &mut Local) {
        let Some(energy) = self.energy else { return };
        for (element, corner) in self.of(vertex) {
            let at = energy.at_node(element.deformation(x), element.gradients[corner]);
            if let Some((gradient, block)) = at {
                local.force -= (element.volume * gradient).as_vec3a();
                local.block += Mat3A::from((block * element.volume).as_mat3());
            }
        }
    }
}

impl Element {
    /// The deformation gradient.
    fn deformation(&self, x: &[Vec3A]) -> DMat3 {
        let at = |k: usize| x[self.nodes[k] as usize].as_dvec3();
        let origin = at(0);
        let edges = DMat3::from_cols(at(1) - origin, at(2) - origin, at(3) - origin);
        let [_, a, b, c] = self.gradients;
        edges * DMat3::from_cols(a, b, c).transpose()
    }
}
