//! Errors of the search for a minimum.

use crate::oracle::Failure;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An input that cannot be used, or a minimum that was not found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A body, model or stepper that `trocar-tissue` refuses.
    #[error(transparent)]
    Tissue(#[from] trocar_tissue::Error),
    /// Settings, a time step or a state that cannot be used.
    #[error("{0}")]
    Invalid(String),
    /// A step or an equilibrium that the oracle did not find.
    #[error("body '{body}': {failure}")]
    Unsolved {
        /// Its name.
        body: String,
        /// Why.
        failure: Failure,
    },
}
