//! What friction remembers from frame to frame: it belongs to the state.

use glam::Vec3A;

/// What a vertex touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Source {
    /// The body's support of this number.
    Support(u32),
    /// The model's collider of this number.
    Collider(u32),
    /// The body of this number.
    Body(u32),
    /// The grasp of this number, and its node of this number: it holds from both sides.
    Grasp(u32, u32),
    /// The body's thread of this number.
    Tether(u32),
}

impl Source {
    /// Whether the quasi-Newton solver's factor always has its stiffness.
    pub fn is_in_factor(self) -> bool {
        matches!(self, Self::Grasp(..) | Self::Tether(_))
    }
}

/// Where friction holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Anchor {
    pub vertex: u32,
    pub source: Source,
    /// In the frame of the touched surface: the tool's, or for a support the body's (m). It moves
    /// with a tool.
    pub place: Vec3A,
}

/// Name of an edge or triangle that touches a round part of a tool: its vertices, ascending, but
/// that an edge repeats the first at the end; and the end of the axis that a triangle meets, 0 for
/// an edge.
pub(crate) type FeatureKey = ([u32; 3], u8);

/// Where a point of an edge or triangle is that presses on a collider, and how far friction's
/// spring between them is stretched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FeatureAnchor {
    pub collider: u32,
    /// The edge or triangle, and the end of the axis.
    pub feature: FeatureKey,
    /// The point from where friction holds it without force, in the tool's frame (m).
    pub stretch: Vec3A,
    /// The shares of the vertices in the point.
    pub weights: [f32; 3],
}

/// How far friction's spring between a vertex and another body is stretched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    pub vertex: u32,
    pub other: u32,
    /// The vertex from where friction holds it without force (m).
    pub by: Vec3A,
}
