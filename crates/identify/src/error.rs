//! Errors of identification.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Lifts from which nothing can be identified.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The specimen has no such organ.
    #[error("the specimen has no organ '{organ}'; it has {known}")]
    NoOrgan {
        /// The organ.
        organ: String,
        /// The organs of the specimen.
        known: String,
    },
    /// The organ or the lifts do not do.
    #[error("{0}")]
    Lifts(String),
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// A model cannot be built.
    #[error(transparent)]
    Cell(#[from] trocar_cell::Error),
    /// The user interrupted the work.
    #[error("interrupted")]
    Interrupted,
}
