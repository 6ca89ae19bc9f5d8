//! Errors of recording a phantom.

/// Result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a phantom cannot be built or recorded.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is no phantom of that name.
    #[error("no phantom '{name}'; the phantoms are {known}{hint}", hint = nearest.map(|n| format!("; did you mean '{n}'?")).unwrap_or_default())]
    Unknown {
        /// The name that was given.
        name: String,
        /// The most similar known name.
        nearest: Option<&'static str>,
        /// All known names.
        known: String,
    },
    /// An option is out of range.
    #[error("{0}")]
    Option(String),
    /// The user interrupted the recording.
    #[error("interrupted")]
    Interrupted,
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// An image cannot be written.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// A mesh cannot be written.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// The lifted tissue has no equilibrium.
    #[error("lifted tissue: {0}")]
    Tissue(#[from] trocar_tissue_reference::Error),
}
