//! What can go wrong while a phantom is recorded.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A phantom that cannot be made or recorded.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is no phantom of that name.
    #[error("no phantom '{name}'; the phantoms are {known}{hint}", hint = nearest.map(|n| format!("; did you mean '{n}'?")).unwrap_or_default())]
    Unknown {
        /// What was asked for.
        name: String,
        /// The phantom whose name is alike.
        nearest: Option<&'static str>,
        /// All names.
        known: String,
    },
    /// An option is out of range.
    #[error("{0}")]
    Option(String),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// An image cannot be written.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
}
