//! A collision surface of its own: a mesh that touches tools and other bodies in the place of the
//! boundary of the elements.
//!
//! It is bound once, at rest. Each of its vertices is a fixed weighted sum of the nodes of one
//! element, x = W q. A force f on it acts on the nodes as W' f, so force and torque are the same.
//! Solvers number its vertices after the nodes.

use glam::{DVec3, Vec3A};
use trocar_geometry::TriMesh;

/// The collision surface of a body that has one of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionSurface {
    pub(crate) mesh: TriMesh,
    /// Of each vertex the nodes of its element in their original order, and their weights.
    pub(crate) bindings: Vec<([u32; 4], [f64; 4])>,
}

impl CollisionSurface {
    /// Triangles, and their vertices at rest (m).
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The nodes that a vertex moves with, and their weights: together 1, and negative where the
    /// vertex is outside of its element. On a lattice a vertex moves with a cell; these nodes are
    /// near it.
    pub fn nodes_of(&self, vertex: usize) -> ([u32; 4], [f64; 4]) {
        self.bindings[vertex]
    }

    /// Where a vertex is with the nodes at `nodes` (m).
    pub(crate) fn place(&self, vertex: usize, nodes: impl Fn(usize) -> DVec3) -> DVec3 {
        let (of, weights) = self.bindings[vertex];
        of.iter().zip(weights).map(|(node, weight)| weight * nodes(*node as usize)).sum()
    }
}

/// A vertex of a collision surface as solvers see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoundVertex {
    /// The nodes of its element, as the solver numbers them.
    pub nodes: [u32; 4],
    /// Their weights.
    pub weights: [f32; 4],
    /// Sum of the weights' magnitudes: 1 inside of the element.
    pub spread: f32,
    /// Stiffness of contacts (N/m).
    pub stiffness: f32,
}

impl BoundVertex {
    /// The weighted sum of a field over the nodes.
    #[inline(always)]
    pub fn sum(&self, field: impl Fn(u32) -> Vec3A) -> Vec3A {
        let part = |k: usize| self.weights[k] * field(self.nodes[k]);
        part(0) + part(1) + part(2) + part(3)
    }

    /// The nodes that move it, with their weights.
    #[inline(always)]
    pub fn shares(&self) -> impl Iterator<Item = (u32, f32)> {
        self.nodes.into_iter().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }
}
