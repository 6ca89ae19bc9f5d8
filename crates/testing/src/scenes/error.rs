//! What can go wrong with scenes.

/// Result of scenes.
pub type Result<T> = std::result::Result<T, Error>;

/// A scene that cannot be made or stepped.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// There is no such scene, or its organs do not fit it.
    #[error("{0}")]
    Mismatch(String),
    /// A scene blew up.
    #[error("scene '{scene}', frame {frame}: {why}")]
    Diverged {
        /// The scene.
        scene: &'static str,
        /// Its frame.
        frame: usize,
        /// What happened.
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
