//! What can go wrong with a specimen folder.

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
        /// What the system said.
        source: std::io::Error,
    },
    /// `specimen.toml` does not say what it should.
    #[error("{path}: {reason}", path = path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Field, what is wrong with it, what would be right.
        reason: String,
    },
    /// A mesh of the specimen is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// An image of the specimen is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
}
