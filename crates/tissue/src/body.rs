//! One deformable body, laid out for the sweeps.
//!
//! Vertices are renumbered by colour, so that the vertices of one colour are a range and the pinned ones, which have none, the last; and their positions are kept relative to the body's own
//! origin: rounding of `f32` is then far below the sags that are measured. What a vertex needs of its elements and edges stands in
//! one piece, in the order the sweeps read it.

use crate::contact::surface::Surface;
use crate::descent::elements::Elements;
use crate::descent::groups::Groups;
use crate::{Material, Support};
use glam::{DVec3, Vec3A};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use trocar_geometry::TetMesh;

/// One deformable body. A clone is the same body, not a copy: models that follow from each other by cuts share what was not cut.
#[derive(Clone, Debug)]
pub struct Body(Arc<BodyData>);

/// What a body is made of.
#[derive(Clone, Debug)]
pub struct BodyData {
    pub(crate) name: String,
    pub(crate) material: Material,
    pub(crate) raised_masses: usize,
    pub(crate) parts: usize,
    pub(crate) supports: Vec<Support>,
    /// Stiffness of contacts over Young's modulus times a node's size.
    pub(crate) contact_stiffness: f64,
    /// Rest shape, original node order [m].
    pub(crate) rest: TetMesh,
    /// Whether each node is pinned, original order.
    pub(crate) pinned: Vec<bool>,
    pub(crate) median_edge: f64,
    /// World position of the body's own origin [m].
    pub(crate) origin: DVec3,
    /// Its boundary.
    pub(crate) surface: Surface,
    /// Internal number of each node.
    pub(crate) internal: Vec<u32>,
    /// First vertex of each colour, and the number of vertices that are not pinned.
    pub(crate) color_start: Vec<u32>,
    /// Elements by internal vertex numbers.
    pub(crate) tets: Vec<[u32; 4]>,
    /// Per vertex, internal order.
    pub(crate) vertices: Vec<Vertex>,
    /// Element corners, by vertex.
    pub(crate) corners: Vec<Corner>,
    /// Rest gradients of the three other corners' shape functions for each of `corners` [1/m]; empty for stable neo-Hookean tissue.
    pub(crate) gradients: Vec<[Vec3A; 3]>,
    /// Edges, by vertex.
    pub(crate) edges: Vec<Edge>,
    /// The free vertices as the lanes of the sweeps read them; empty unless the tissue is stable neo-Hookean.
    pub(crate) groups: Groups,
    /// The elements that can move, in lanes; none for bodies of hundreds of millions of nodes.
    pub(crate) elements: Option<Elements>,
    /// Rest volume of each element [m3], by `tets`.
    pub(crate) volumes: Vec<f64>,
}

/// What a sweep needs to know of a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    /// Mass [kg].
    pub mass: f32,
    pub pinned: bool,
    /// First corner and edge of this vertex; the next vertex's are their ends.
    pub corners: u32,
    pub edges: u32,
    /// Constant diagonal of the elastic block [N/m] (stable neo-Hookean's mu part).
    pub laplacian: f32,
    /// Stiffness of the support planes against this vertex [N/m].
    pub contact_stiffness: f32,
}

/// A vertex as a corner of one element.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// The other three corners, oriented so that (b-a)x(c-a).(x-a)/6 is the element's volume.
    pub others: [u32; 3],
    /// 1 / (6 V0) [1/m3].
    pub inverse_6v: f32,
    /// V0 [m3].
    pub volume: f32,
}

/// A vertex's edge to a neighbour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub to: u32,
    /// mu sum_t V0 m_i.m_j over the elements at the edge [N/m] (stable neo-Hookean's mu part); minus a spring's stiffness.
    pub laplacian: f32,
    /// Dashpot along the edge [N s/m].
    pub damping: f32,
    /// Rest length [m].
    pub length: f32,
}

impl Deref for Body {
    type Target = BodyData;

    fn deref(&self) -> &BodyData {
        &self.0
    }
}

impl DerefMut for Body {
    /// Only the builder changes a body, before anyone shares it.
    fn deref_mut(&mut self) -> &mut BodyData {
        Arc::make_mut(&mut self.0)
    }
}

impl From<BodyData> for Body {
    fn from(data: BodyData) -> Self {
        Self(Arc::new(data))
    }
}

impl Body {
    /// Whether both are one: laid out once, shared by two models.
    pub(crate) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Whether a solver that was made for the other steps this one to the same bits.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        self.is(other)
            || (self.tets == other.tets
                && self.rest.vertices == other.rest.vertices
                && self.material == other.material
                && self.pinned == other.pinned
                && self.supports == other.supports
                && self.contact_stiffness == other.contact_stiffness)
    }

    /// Name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Nodes whose mass was raised to the [`crate::MassFloor`] (SPEC T5).
    pub fn raised_masses(&self) -> usize {
        self.raised_masses
    }

    /// Pieces that hang together by shared nodes. A body of more than one is no mistake by itself, but a piece without pins or support falls away from the others.
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// What it rests on.
    pub fn supports(&self) -> &[Support] {
        &self.supports
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.internal.len()
    }

    /// True without nodes (a built body never is).
    pub fn is_empty(&self) -> bool {
        self.internal.is_empty()
    }

    /// Whether each node is pinned.
    pub fn pinned(&self) -> &[bool] {
        &self.pinned
    }

    /// Rest positions of the nodes [m].
    pub fn rest_positions(&self) -> &[DVec3] {
        &self.rest.vertices
    }

    /// Elements by node.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.rest.tets
    }

    /// Median edge length at rest [m].
    pub fn median_edge(&self) -> f64 {
        self.median_edge
    }

    /// Mass of a node [kg].
    pub fn mass(&self, node: usize) -> f64 {
        f64::from(self.vertices[self.internal[node] as usize].mass)
    }

    /// Rest shape (m).
    pub fn rest(&self) -> &TetMesh {
        &self.rest
    }

    /// Rest volumes of the elements (m3).
    pub fn volumes(&self) -> &[f64] {
        &self.volumes
    }

    /// World position of the body's own origin (m). A state keeps positions relative to it.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Stiffness of a support or a tool against a node (N/m).
    pub fn contact_stiffness(&self, node: usize) -> f64 {
        f64::from(self.vertices[self.internal[node] as usize].contact_stiffness)
    }

    /// Edges with a dashpot and its coefficient (N s/m), each once, smaller node first, in
    /// ascending order.
    pub fn dashpots(&self) -> Vec<([u32; 2], f64)> {
        let nodes = self.nodes_of_vertices();
        let mut dashpots = Vec::new();
        for (node, vertex) in self.internal.iter().enumerate() {
            for edge in self.edges_of(*vertex as usize) {
                let to = nodes[edge.to as usize];
                if to > node && edge.damping > 0.0 {
                    dashpots.push(([node as u32, to as u32], f64::from(edge.damping)));
                }
            }
        }
        dashpots
    }

    /// Number under which the solvers know each node: nodes of one colour of the sweeps are
    /// adjacent, pinned nodes come last.
    pub fn solver_numbers(&self) -> &[u32] {
        &self.internal
    }

    /// The node of every vertex.
    pub(crate) fn nodes_of_vertices(&self) -> Vec<usize> {
        let mut nodes = vec![0; self.len()];
        self.internal.iter().enumerate().for_each(|(node, vertex)| nodes[*vertex as usize] = node);
        nodes
    }

    /// Young's modulus times the size of a vertex [N/m].
    pub(crate) fn tissue_stiffness(&self, vertex: usize) -> f32 {
        self.vertices[vertex].contact_stiffness / self.contact_stiffness as f32
    }

    /// Free vertices of the surface (internal numbers), ascending.
    pub(crate) fn surface_vertices(&self) -> Vec<u32> {
        let free = |i: &u32| self.surface.areas[*i as usize] > 0.0 && !self.vertices[*i as usize].pinned;
        (0..self.vertices.len() as u32).filter(free).collect()
    }

    /// Number of colours of the sweeps.
    pub fn colors(&self) -> usize {
        self.color_start.len() - 1
    }

    pub(crate) fn corners_of(&self, vertex: usize) -> std::ops::Range<usize> {
        let end = self.vertices.get(vertex + 1).map_or(self.corners.len(), |v| v.corners as usize);
        self.vertices[vertex].corners as usize..end
    }

    pub(crate) fn edges_of(&self, vertex: usize) -> &[Edge] {
        let end = self.vertices.get(vertex + 1).map_or(self.edges.len(), |v| v.edges as usize);
        &self.edges[self.vertices[vertex].edges as usize..end]
    }
}
