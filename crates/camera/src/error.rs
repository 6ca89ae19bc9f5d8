//! What can go wrong with an image or a camera.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable image or camera.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An image file could not be read, decoded or written.
    #[error("{path}: {reason}", path = path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A calibration file could not be read, understood or written.
    #[error("{path}: {reason}", path = path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// The camera's numbers make no sense.
    #[error("{0}")]
    Camera(String),
}
