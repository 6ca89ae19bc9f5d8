//! What of a body's surface touches tools.

/// What of a body's surface touches tools.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToolContact {
    /// Its vertices. A tool that is thinner than triangles are wide can pass between them.
    #[default]
    Vertices,
    /// Its vertices, edges and triangles against spheres and capsules; its vertices against other
    /// shapes.
    Surface,
}
