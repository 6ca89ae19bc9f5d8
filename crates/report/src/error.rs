//! Errors of pages, plots and pictures.

/// The result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A plot or picture that cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A picture whose number of pixels differs from its size.
    #[error("{0}")]
    Mismatch(String),
    /// A plot that cannot be drawn.
    #[error("plot '{plot}': {reason}")]
    Plot {
        /// Title of the plot.
        plot: String,
        /// The error of the drawing library.
        reason: String,
    },
    /// A picture that cannot be encoded.
    #[error("a picture cannot be encoded: {0}")]
    Picture(#[from] image::ImageError),
}
