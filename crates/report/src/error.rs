//! What can go wrong while a page is drawn.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A plot or picture that cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A picture whose pixels are not as many as its size says.
    #[error("{0}")]
    Mismatch(String),
    /// A plot could not be drawn.
    #[error("plot '{plot}': {reason}")]
    Plot {
        /// Its title.
        plot: String,
        /// What the drawing library said.
        reason: String,
    },
    /// A picture could not be encoded.
    #[error("a picture cannot be encoded: {0}")]
    Picture(#[from] image::ImageError),
}
