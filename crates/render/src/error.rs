//! Errors of a stage.

/// Result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An identifier or a mesh that does not fit the stage.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Error {
    /// The stage has no such shape or body.
    #[error("there is no {what} {index}; the stage has {count}")]
    Unknown {
        /// `shape` or `body`.
        what: &'static str,
        /// The index that was given.
        index: usize,
        /// The number of them on the stage.
        count: usize,
    },
    /// The number of positions differs from the shape's number of vertices.
    #[error("shape {shape} has {has} vertices, but {given} positions were given")]
    Vertices {
        /// Index of the shape.
        shape: usize,
        /// Number of vertices of the shape.
        has: usize,
        /// Number of positions that were given.
        given: usize,
    },
    /// The mesh has more triangles than a search tree can index.
    #[error("the mesh has {0} triangles; must be at most 2^27")]
    TooLarge(usize),
    /// The bodies have more triangles than a picture can tell apart.
    #[error("the bodies of the stage have {0} triangles; must be less than 2^32")]
    TooMany(usize),
}
