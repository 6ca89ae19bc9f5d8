//! Errors of building a model. A built model cannot be wrong.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A model or a stepper that cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A body is unusable; names the body and the element, node or parameter.
    #[error("body '{body}': {reason}")]
    Body {
        /// Its name.
        body: String,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A parameter of the whole model is unusable.
    #[error("{0}")]
    Model(String),
    /// A graphics card that is missing, too small, or lost.
    #[cfg(feature = "gpu")]
    #[error("{0}")]
    Gpu(String),
}
