//! Errors of a camera rig.

/// Result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a camera rig cannot be built or cannot render.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The rig has no such camera.
    #[error("there is no camera '{name}'; the cameras are {known}")]
    UnknownCamera {
        /// The name that was given.
        name: String,
        /// Names of all cameras.
        known: String,
    },
    /// A camera has no lens model.
    #[error("camera '{name}' {reason}")]
    Camera {
        /// Name of the camera.
        name: String,
        /// The cause and the remedy.
        reason: String,
    },
    /// An arm cannot be drawn from its description.
    #[error("arm '{arm}': {reason}")]
    Shapes {
        /// Name of the arm.
        arm: String,
        /// File, link, cause and remedy.
        reason: String,
    },
    /// The picture is too small or too large.
    #[error("picture size {0} x {1} px is out of range; width and height must be in [8, 8192]")]
    Size(usize, usize),
    /// The cell belongs to another scene or specimen.
    #[error("the cell belongs to another scene or specimen: {0}")]
    Mismatch(String),
    /// Depth noise cannot be applied.
    #[error(transparent)]
    Images(#[from] trocar_camera::Error),
    /// A mesh or an identifier does not fit the stage.
    #[error(transparent)]
    Render(#[from] trocar_render::Error),
    /// The cell rejects a query.
    #[error(transparent)]
    Cell(#[from] trocar_cell::Error),
}
