//! What can go wrong with a scene file.

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
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not say what a scene should.
    #[error("{file}: {reason}")]
    Invalid {
        /// The file, or the name of a built-in scene.
        file: String,
        /// Line, field, what is wrong with it, what would be right.
        reason: String,
    },
    /// Neither a file nor a built-in scene.
    #[error("no scene '{name}'; a TOML file, or one of the built-in scenes {known}{hint}", hint = nearest.as_ref().map(|n| format!("; did you mean '{n}'?")).unwrap_or_default())]
    Unknown {
        /// What was asked for.
        name: String,
        /// The built-in scenes.
        known: String,
        /// The one most like it.
        nearest: Option<String>,
    },
    /// The scene cannot be written as TOML.
    #[error("the scene cannot be written: {0}")]
    Write(String),
    /// The specimen that the scene names is unusable.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}
