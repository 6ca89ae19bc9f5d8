//! Nodes of the tree and their boxes.

use glam::Vec3A;

/// Children per node and triangles per leaf.
pub(super) const WIDTH: usize = 8;
/// Marks an unused child.
pub(super) const NO_CHILD: u32 = u32::MAX;
/// Marks a child that is a leaf.
pub(super) const LEAF_BIT: u32 = 1 << 31;
/// Entry node of a whole tree.
pub(crate) const ROOT: u32 = 0;

/// Size of the traversal stack: each level leaves at most seven siblings behind.
pub(super) const STACK_SIZE: usize = 128;
/// Maximum depth. Only degenerate meshes give deeper trees; these are rebuilt without regard to the
/// boxes.
pub(super) const MAX_DEPTH: usize = STACK_SIZE / (WIDTH - 1) - 1;

/// Boxes of the children, by bound (low x y z, high x y z).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub(super) bounds: [[f32; WIDTH]; 6],
    pub(super) child: [u32; WIDTH],
}

/// An axis-aligned box; empty if low exceeds high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: Vec3A,
    pub high: Vec3A,
}

impl Bounds {
    pub const EMPTY: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    /// Half the surface area (m²).
    #[inline]
    pub fn half_area(&self) -> f32 {
        let d = self.high - self.low;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// The box extended by a point. A non-finite point changes nothing.
    #[inline]
    pub fn with(self, p: Vec3A) -> Self {
        if p.is_finite() { Self { low: self.low.min(p), high: self.high.max(p) } } else { self }
    }
}
