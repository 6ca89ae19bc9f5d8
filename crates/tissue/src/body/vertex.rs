//! The vertices of a body as the sweeps read them: each with its element corners and edges.

/// Data of a vertex for a sweep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    /// Mass (kg).
    pub mass: f32,
    pub pinned: bool,
    /// First corner and edge of this vertex; those of the next vertex are the ends.
    pub corners: u32,
    pub edges: u32,
    /// Constant diagonal of the elastic block (N/m) (stable neo-Hookean's mu part).
    pub laplacian: f32,
    /// Stiffness of the support planes against this vertex (N/m).
    pub contact_stiffness: f32,
}

/// A vertex as a corner of one element.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// The other three corners, oriented so that (b-a)x(c-a).(x-a)/6 is the element's volume.
    pub others: [u32; 3],
    /// 1 / (6 V0) (1/m3).
    pub inverse_6v: f32,
    /// V0 (m3).
    pub volume: f32,
}

/// A vertex's edge to a neighbour.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub to: u32,
    /// mu sum_t V0 m_i.m_j over the elements at the edge (N/m) (stable neo-Hookean's mu part);
    /// minus a spring's stiffness.
    pub laplacian: f32,
    /// Dashpot along the edge (N s/m).
    pub damping: f32,
    /// Rest length (m).
    pub length: f32,
}

/// All vertices of a body with their corners and edges.
#[derive(Clone, Copy)]
pub(crate) struct VertexTable<'a> {
    pub vertices: &'a [Vertex],
    pub corners: &'a [Corner],
    pub edges: &'a [Edge],
    /// First vertex of each colour, and the number of vertices that are not pinned.
    pub color_start: &'a [u32],
}

impl<'a> VertexTable<'a> {
    /// Range of a vertex's corners.
    #[inline(always)]
    pub fn corners_of(&self, vertex: usize) -> std::ops::Range<usize> {
        let end = self.vertices.get(vertex + 1).map_or(self.corners.len(), |v| v.corners as usize);
        self.vertices[vertex].corners as usize..end
    }

    /// A vertex's edges.
    #[inline(always)]
    pub fn edges_of(&self, vertex: usize) -> &'a [Edge] {
        let end = self.vertices.get(vertex + 1).map_or(self.edges.len(), |v| v.edges as usize);
        &self.edges[self.vertices[vertex].edges as usize..end]
    }
}
