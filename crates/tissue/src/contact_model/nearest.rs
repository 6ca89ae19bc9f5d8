//! The answer to a query of the nearest point of a shape.

use glam::DVec3;

/// Largest coordinate and size of a shape (m). More is a mistaken unit.
pub(super) const MAX_SHAPE_SIZE: f64 = 10.0;

/// The point of a shape's surface nearest to some point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Signed distance (m): negative inside.
    pub distance: f64,
    /// Unit normal there, outwards: the gradient of the distance. Where several are possible (a
    /// sphere's centre, an edge), one of them.
    pub normal: DVec3,
}
