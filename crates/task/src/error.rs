//! Errors of episodes and of their files.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An episode that cannot be run, or a file that is none.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A task, a policy or an option that cannot be.
    #[error("{0}")]
    Option(String),
    /// The episode is over.
    #[error("the episode ended: {0}; reset it before the next step")]
    Ended(String),
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file is not what it should be.
    #[error("{path}: {reason}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, what would be right.
        reason: String,
    },
    /// The cell refuses, an action for instance.
    #[error(transparent)]
    Cell(#[from] trocar_cell::Error),
    /// The scene is unusable.
    #[error(transparent)]
    Scene(#[from] trocar_scene::Error),
}
