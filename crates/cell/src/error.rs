//! What can go wrong while a task is set up or run.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A task that cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The specimen has no organ of that name.
    #[error("no organ '{name}' in the specimen; it has {known}")]
    UnknownOrgan {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// An option is out of range, or nothing can be grasped there.
    #[error("{0}")]
    Option(String),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The model cannot be built.
    #[error(transparent)]
    Tissue(#[from] trocar_tissue::Error),
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// The specimen is unusable.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}
