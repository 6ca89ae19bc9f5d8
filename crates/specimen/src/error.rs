//! Errors of specimen folders.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable specimen.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened, read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A file of the specimen has wrong contents.
    #[error("{path}: {reason}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The field, what is wrong with it, and what would be right.
        reason: String,
    },
    /// An organ of one specimen cannot be in another.
    #[error("organ '{organ}' {reason}")]
    Swap {
        /// The organ.
        organ: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A mesh of the specimen is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// An image of the specimen is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
}
