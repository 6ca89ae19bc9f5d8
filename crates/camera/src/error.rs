//! Errors of images, calibration files and cameras.

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
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A calibration file could not be read, parsed or written.
    #[error("{path}: {reason}", path = path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// Invalid parameters or image sizes of a camera.
    #[error("{0}")]
    Camera(String),
}
