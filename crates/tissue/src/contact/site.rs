//! Where on a body's surface a contact acts.

use glam::Vec3A;

/// A point of a body's surface: a vertex, a point of an edge or of a triangle. It moves with its
/// vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Site {
    /// The vertices; those beyond the last one repeat the first.
    pub vertices: [u32; 3],
    /// Their shares of the point, and of the force: together 1, and 0 beyond the last vertex.
    pub weights: [f32; 3],
}

impl Site {
    /// A vertex.
    #[inline(always)]
    pub fn vertex(vertex: u32) -> Self {
        Self { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0] }
    }

    /// Whether it is a vertex.
    #[inline(always)]
    pub fn is_vertex(&self) -> bool {
        self.weights[0] == 1.0
    }

    /// The first vertex: the only one of a vertex.
    #[inline(always)]
    pub fn first(&self) -> u32 {
        self.vertices[0]
    }

    /// The point, with each vertex at `x`.
    #[inline(always)]
    pub fn at(&self, x: impl Fn(u32) -> Vec3A) -> Vec3A {
        let first = x(self.vertices[0]);
        if self.is_vertex() {
            return first;
        }
        self.weights[0] * first + self.weights[1] * x(self.vertices[1]) + self.weights[2] * x(self.vertices[2])
    }

    /// The vertices that bear force, with their shares.
    #[inline(always)]
    pub fn shares(self) -> impl Iterator<Item = (u32, f32)> {
        self.vertices.into_iter().zip(self.weights).filter(|(_, weight)| *weight > 0.0)
    }
}

/// Adds a share to that of the same node, which several vertices of a collision surface may move
/// with.
pub(super) fn add_share<N: PartialEq>(shares: &mut Vec<(N, f32)>, node: N, share: f32) {
    match shares.iter_mut().find(|(other, _)| *other == node) {
        Some((_, sum)) => *sum += share,
        None => shares.push((node, share)),
    }
}
