//! Vertices of shapes.

use glam::Vec3A;

/// A vertex of a shape. The data that a pixel needs of it are adjacent in memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vertex {
    pub position: [f32; 4],
    pub normal: [f32; 4],
    /// Linear colour.
    pub color: [f32; 4],
}

#[inline(always)]
pub(super) fn vector([x, y, z, _]: &[f32; 4]) -> Vec3A {
    Vec3A::new(*x, *y, *z)
}
