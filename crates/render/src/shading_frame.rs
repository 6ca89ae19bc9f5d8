//! The local frame at a surface point, and the start of rays from it.

use glam::Vec3A;

/// Offset of a ray's start from the surface (m). It exceeds the rounding error of the position.
pub(crate) fn offset(position: Vec3A) -> f32 {
    2e-6 * (0.05 + position.abs().max_element())
}

/// Local axes at a surface point.
pub(crate) struct ShadingFrame {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
}

impl ShadingFrame {
    pub fn new(normal: Vec3A) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        Self { x, y, z: normal }
    }

    pub fn local(&self, d: Vec3A) -> Vec3A {
        Vec3A::new(self.x.dot(d), self.y.dot(d), self.z.dot(d))
    }

    pub fn world(&self, d: Vec3A) -> Vec3A {
        self.x * d.x + self.y * d.y + self.z * d.z
    }
}
