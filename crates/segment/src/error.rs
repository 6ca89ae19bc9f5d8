//! Errors of segmentation.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A target that cannot be found, or a segmenter that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An image file is unusable.
    #[error(transparent)]
    Image(#[from] trocar_camera::Error),
    /// The target's points, box or outline are unusable.
    #[error("target '{target}': {reason}")]
    Target {
        /// Its name.
        target: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A picture has the wrong size.
    #[error("{picture}: {reason}")]
    Picture {
        /// Its name.
        picture: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A file or folder cannot be used.
    #[error("{path}: {reason}", path = path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// ONNX Runtime's library is missing or unusable.
    #[error("ONNX Runtime: {0}")]
    Runtime(String),
    /// A parameter is out of its range.
    #[error("{0}")]
    Setting(String),
}

impl Error {
    pub(crate) fn file(path: &std::path::Path, reason: impl std::fmt::Display) -> Self {
        // Some libraries' messages have several lines; ours have one.
        let reason = reason.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        Self::File { path: path.to_owned(), reason }
    }
}
