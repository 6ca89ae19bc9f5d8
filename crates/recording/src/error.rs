//! Errors of recordings.

use std::path::{Path, PathBuf};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable recording, or one that cannot be written.
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
    /// The recording is incomplete or inconsistent.
    #[error("{path}: {reason}", path = path.display())]
    Recording {
        /// File or folder.
        path: PathBuf,
        /// The field or frame, what is wrong, and what would be right.
        reason: String,
    },
    /// A bag or MCAP file is unusable.
    #[error(transparent)]
    Messages(#[from] crate::messages::Error),
    /// An image or camera is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// `recording.toml` cannot be read, or the folder cannot be written.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}

impl Error {
    /// A [`Error::Recording`] about `path`.
    pub(crate) fn wrong(path: &Path, reason: impl Into<String>) -> Self {
        Self::Recording { path: path.to_owned(), reason: reason.into() }
    }

    /// A [`Error::Io`] about `path`.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}
