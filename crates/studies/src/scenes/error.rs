//! Errors of scenes.

/// Result of this module.
pub type Result<T> = std::result::Result<T, Error>;

/// A scene could not be made or stepped.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An unknown scene, or organs that do not fit it.
    #[error("{0}")]
    Mismatch(String),
    /// A scene diverged.
    #[error("scene '{scene}', frame {frame}: {why}")]
    Diverged {
        /// The scene.
        scene: &'static str,
        /// The frame.
        frame: usize,
        /// The reason.
        why: String,
    },
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// A model cannot be built or stepped.
    #[error(transparent)]
    Tissue(#[from] trocar_tissue::Error),
    /// The oracle or a comparator failed.
    #[error(transparent)]
    Reference(#[from] trocar_tissue_reference::Error),
}
