//! What can go wrong with a cell's cameras.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A picture that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No such camera.
    #[error("there is no camera '{name}'; the cameras are {known}")]
    UnknownCamera {
        /// What was asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// A camera has no lens.
    #[error("camera '{name}' {reason}")]
    Camera {
        /// The camera.
        name: String,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// An arm cannot be drawn from its description.
    #[error("arm '{arm}': {reason}")]
    Shapes {
        /// The arm.
        arm: String,
        /// File and link, what is wrong and what would be right.
        reason: String,
    },
    /// A size that no picture has.
    #[error("a picture of {0} x {1} pixels; 8 to 8192 each")]
    Size(usize, usize),
    /// A cell of another scene or specimen.
    #[error("the cell is not of this scene and specimen: {0}")]
    Mismatch(String),
    /// A depth image cannot be given its noise.
    #[error(transparent)]
    Images(#[from] trocar_camera::Error),
    /// Something does not fit on the stage.
    #[error(transparent)]
    Render(#[from] trocar_render::Error),
    /// The cell cannot be asked.
    #[error(transparent)]
    Cell(#[from] trocar_cell::Error),
}
