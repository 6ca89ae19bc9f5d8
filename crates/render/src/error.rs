//! What can be wrong with a stage.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Something that a stage does not have, or that does not fit it.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Error {
    /// No such shape or body.
    #[error("there is no {what} {index}; the stage has {count}")]
    Unknown {
        /// `shape` or `body`.
        what: &'static str,
        /// What was asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A shape was given another number of vertices.
    #[error("shape {shape} has {has} vertices, but {given} positions were given")]
    Vertices {
        /// The shape.
        shape: usize,
        /// Its vertices.
        has: usize,
        /// Positions given.
        given: usize,
    },
    /// The stage would have more than the trees can number.
    #[error("a mesh of {0} triangles is too large; at most 2^27 fit")]
    TooLarge(usize),
}
