//! What can go wrong on the way from a recording to a specimen.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable recording, or a stage that cannot do its work.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The recording, or the surface in its place, is not what it should be.
    #[error("{path}: {reason}", path = path.display())]
    Input {
        /// File or folder.
        path: PathBuf,
        /// Field or frame, what is wrong, what would be right.
        reason: String,
    },
    /// An organ cannot be reconstructed.
    #[error("organ '{organ}': {reason}")]
    Organ {
        /// Its name.
        organ: String,
        /// Why, and what would help.
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
    /// Something cannot be found in a picture.
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
