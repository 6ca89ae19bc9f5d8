//! Errors of scene files.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An unusable scene.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened or read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The contents of the file are wrong.
    #[error("{file}: {reason}")]
    Invalid {
        /// The file, or the name of a built-in scene.
        file: String,
        /// Line and field, what is wrong, and what would be right.
        reason: String,
    },
    /// Neither a file nor a built-in scene.
    #[error("no scene '{name}'; it must be a TOML file or one of the built-in scenes {known}{hint}", hint = nearest.as_ref().map(|n| format!("; did you mean '{n}'?")).unwrap_or_default())]
    Unknown {
        /// The given name.
        name: String,
        /// The built-in scenes.
        known: String,
        /// The most similar built-in scene.
        nearest: Option<String>,
    },
    /// The scene cannot be written as TOML.
    #[error("the scene cannot be written: {0}")]
    Write(String),
    /// The specimen that the scene names is unusable.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}
