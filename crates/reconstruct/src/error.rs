//! Errors of the reconstruction.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable recording, or a stage that fails.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The recording, or the surface file, has wrong contents.
    #[error("{path}: {reason}", path = path.display())]
    Input {
        /// File or folder.
        path: PathBuf,
        /// The field or frame, what is wrong, and what would be right.
        reason: String,
    },
    /// An organ cannot be reconstructed.
    #[error("organ '{organ}': {reason}")]
    Organ {
        /// Its name.
        organ: String,
        /// The reason, and what would help.
        reason: String,
    },
    /// A setting is out of range.
    #[error("{0}")]
    Setting(String),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The recording is unusable.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// A target cannot be found in an image.
    #[error(transparent)]
    Segment(#[from] trocar_segment::Error),
    /// An image or camera is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// The specimen cannot be written.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}
