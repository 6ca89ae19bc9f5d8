//! One deformable body, laid out for the sweeps.
//!
//! Vertices are renumbered by colour: those of one colour are a range, and pinned vertices, which
//! have no colour, come last. Positions are relative to the body's own origin, which keeps the
//! rounding of `f32` far below the measured sags. The data that a vertex needs of its elements and
//! edges are adjacent, in the order in which the sweeps read them.

mod collision;
pub(crate) mod coloring;
pub(crate) mod element_lanes;
mod embedding;
pub(crate) mod groups;
pub(crate) mod strip;
pub(crate) mod surface;
pub(crate) mod tree;
mod vertex;

use crate::{LatticeSettings, Material, Support, Tether};
pub(crate) use collision::BoundVertex;
pub use collision::CollisionSurface;
use element_lanes::ElementLanes;
pub(crate) use embedding::{Embedding, EmbeddingData};
use glam::{DVec3, Vec3A};
use groups::Groups;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use surface::Surface;
use trocar_geometry::TetMesh;
pub(crate) use vertex::{Corner, Edge, Vertex, VertexTable};

/// One deformable body. A clone is the same body, not a copy: models before and after a cut share
/// the bodies that were not cut.
#[derive(Clone, Debug)]
pub struct Body(Arc<BodyData>);

/// The data of a body.
#[derive(Clone, Debug)]
pub struct BodyData {
    pub(crate) name: String,
    pub(crate) material: Material,
    pub(crate) raised_masses: usize,
    pub(crate) parts: usize,
    pub(crate) supports: Vec<Support>,
    /// Threads that hold it.
    pub(crate) tethers: Vec<Tether>,
    /// Stiffness of contacts over Young's modulus times a node's size.
    pub(crate) contact_stiffness: f64,
    /// Rest shape in the original node order (m).
    pub(crate) rest: TetMesh,
    /// Whether each node is pinned, in the original order.
    pub(crate) pinned: Vec<bool>,
    pub(crate) median_edge: f64,
    /// World position of the body's own origin (m).
    pub(crate) origin: DVec3,
    /// A third of the rest area of the boundary's triangles at each node (m2), internal order; 0
    /// inside.
    pub(crate) areas: Vec<f64>,
    /// What touches tools and other bodies: its boundary, or its collision surface.
    pub(crate) surface: Surface,
    /// Its collision surface, if that is not its boundary.
    pub(crate) collision: Option<CollisionSurface>,
    /// The vertices of the collision surface. Vertex k has the internal number `len() + k`.
    pub(crate) bound: Vec<BoundVertex>,
    /// By vertex, the stiffness that they bring to the solver's matrix if all of them are pressed
    /// (N/m); empty without them.
    pub(crate) bound_stiffness: Vec<f32>,
    /// Internal number of each node.
    pub(crate) internal: Vec<u32>,
    /// First vertex of each colour, and the number of vertices that are not pinned.
    pub(crate) color_start: Vec<u32>,
    /// Elements by internal vertex numbers.
    pub(crate) tets: Vec<[u32; 4]>,
    /// Vertices in internal order.
    pub(crate) vertices: Vec<Vertex>,
    /// Element corners, by vertex.
    pub(crate) corners: Vec<Corner>,
    /// Rest gradients of the shape functions of the three other corners, for each of `corners`
    /// (1/m); empty for stable neo-Hookean tissue.
    pub(crate) gradients: Vec<[Vec3A; 3]>,
    /// Edges, by vertex.
    pub(crate) edges: Vec<Edge>,
    /// The free vertices as the lanes of the sweeps read them; empty unless the tissue is stable
    /// neo-Hookean.
    pub(crate) groups: Groups,
    /// The elements that can move, in lanes; None for bodies of hundreds of millions of nodes.
    pub(crate) elements: Option<ElementLanes>,
    /// Rest volume of each element (m3), in the order of `tets`.
    pub(crate) volumes: Vec<f64>,
    /// Its lattice; None if its tetrahedra bear it, or if it is pinned as a whole.
    pub(crate) lattice: Option<Embedding>,
}

impl Deref for Body {
    type Target = BodyData;

    fn deref(&self) -> &BodyData {
        &self.0
    }
}

impl DerefMut for Body {
    /// Only the builder changes a body, before it is shared.
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
    /// Whether both are the same body: laid out once, shared by two models.
    pub(crate) fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Whether a solver of the other body steps this one to the same bits.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        self.is(other)
            || (self.tets == other.tets
                && self.rest.vertices == other.rest.vertices
                && self.material == other.material
                && self.pinned == other.pinned
                && self.supports == other.supports
                && self.tethers == other.tethers
                && self.contact_stiffness == other.contact_stiffness
                && self.lattice_settings() == other.lattice_settings()
                && self.collision == other.collision
                && self.vertices.iter().map(|v| v.mass).eq(other.vertices.iter().map(|v| v.mass)))
    }

    /// How its lattice was made; None without one.
    fn lattice_settings(&self) -> Option<LatticeSettings> {
        self.lattice.as_ref().map(|lattice| lattice.settings)
    }

    /// Name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Nodes whose mass was raised to the [`crate::MassFloor`].
    pub fn raised_masses(&self) -> usize {
        self.raised_masses
    }

    /// Number of pieces that are connected by shared nodes. More than one is no error, but a piece
    /// without pins or support falls away from the others.
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// Its collision surface; None if it is the boundary of its elements.
    pub fn collision_surface(&self) -> Option<&CollisionSurface> {
        self.collision.as_ref()
    }

    /// Surfaces that it rests on.
    pub fn supports(&self) -> &[Support] {
        &self.supports
    }

    /// Threads that hold it.
    pub fn tethers(&self) -> &[Tether] {
        &self.tethers
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

    /// Rest positions of the nodes (m).
    pub fn rest_positions(&self) -> &[DVec3] {
        &self.rest.vertices
    }

    /// Elements by node.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.rest.tets
    }

    /// Median edge length at rest (m).
    pub fn median_edge(&self) -> f64 {
        self.median_edge
    }

    /// Mass of a node (kg).
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

    /// Young's modulus times the size of a node (N/m): what contact between bodies is stiff by.
    pub fn tissue_stiffness(&self, node: usize) -> f64 {
        f64::from(self.tissue_stiffness_of(self.internal[node] as usize))
    }

    /// Young's modulus times the size of a vertex, bound or not (N/m).
    pub(crate) fn tissue_stiffness_of(&self, vertex: usize) -> f32 {
        self.contact_stiffness_of(vertex as u32) / self.contact_stiffness as f32
    }

    /// Stiffness of contacts of a vertex, bound or not (N/m).
    #[inline(always)]
    pub(crate) fn contact_stiffness_of(&self, vertex: u32) -> f32 {
        self.bound_vertex(vertex).map_or_else(|| self.vertices[vertex as usize].contact_stiffness, |b| b.stiffness)
    }

    /// Stiffness that the solver's matrix has for a vertex that is pressed (N/m).
    pub(crate) fn pressed_stiffness(&self, vertex: usize) -> f32 {
        let own = self.vertices[vertex].contact_stiffness;
        self.bound_stiffness.get(vertex).map_or(own, |bound| bound.max(own))
    }

    /// Number of vertices: nodes, and bound vertices after them.
    pub(crate) fn vertex_count(&self) -> usize {
        self.len() + self.bound.len()
    }

    /// A vertex of the collision surface, by its internal number. None for a node.
    #[inline(always)]
    pub(crate) fn bound_vertex(&self, vertex: u32) -> Option<&BoundVertex> {
        self.bound.get((vertex as usize).wrapping_sub(self.internal.len()))
    }

    /// Calls `visit(node, share)` for the nodes (internal numbers) that bear a `share` of something
    /// at a vertex.
    #[inline(always)]
    pub(crate) fn for_nodes(&self, vertex: u32, share: f32, mut visit: impl FnMut(u32, f32)) {
        match self.bound_vertex(vertex) {
            None => visit(vertex, share),
            Some(bound) => bound.shares().for_each(|(node, weight)| visit(node, share * weight)),
        }
    }

    /// Where a vertex is, with the vertices at `x` (m). Those bound to tetrahedra are where the
    /// nodes are, and may not have followed them in `x`.
    #[inline(always)]
    pub(crate) fn place(&self, x: &[Vec3A], vertex: u32) -> Vec3A {
        if (vertex as usize) < self.internal.len() || self.lattice.is_some() {
            return x[vertex as usize];
        }
        self.bound[vertex as usize - self.internal.len()].sum(|node| x[node as usize])
    }

    /// Free nodes of the boundary (internal numbers), ascending.
    pub(crate) fn surface_vertices(&self) -> Vec<u32> {
        let free = |i: &u32| self.areas[*i as usize] > 0.0 && !self.vertices[*i as usize].pinned;
        (0..self.vertices.len() as u32).filter(free).collect()
    }

    /// Number of colours of the sweeps.
    pub fn colors(&self) -> usize {
        self.color_start.len() - 1
    }

    #[inline(always)]
    pub(crate) fn vertex_table(&self) -> VertexTable<'_> {
        let (vertices, corners, edges) = (&self.vertices, &self.corners, &self.edges);
        VertexTable { vertices, corners, edges, color_start: &self.color_start }
    }

    #[inline(always)]
    pub(crate) fn corners_of(&self, vertex: usize) -> std::ops::Range<usize> {
        self.vertex_table().corners_of(vertex)
    }

    #[inline(always)]
    pub(crate) fn edges_of(&self, vertex: usize) -> &[Edge] {
        self.vertex_table().edges_of(vertex)
    }
}
