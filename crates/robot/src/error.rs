//! What can go wrong with an arm or an instrument.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An arm or instrument that cannot be described, or a motion that cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened or read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A description file does not say what it should.
    #[error("{path}: {reason}", path = path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// Element, what is wrong with it, what would be right.
        reason: String,
    },
    /// A value is out of range.
    #[error("{what}: {reason}")]
    Invalid {
        /// The thing and its field.
        what: String,
        /// What is wrong with it, what would be right.
        reason: String,
    },
    /// A number went beyond what can be computed with. The state is as it was before the call.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which number.
        what: &'static str,
    },
}

impl Error {
    /// A value out of range.
    pub(crate) fn invalid(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), reason: reason.into() }
    }
}

/// `value` of `what`, if it is finite and within `low..=high`; `unit` is for the message.
pub(crate) fn within(what: &str, value: f64, low: f64, high: f64, unit: &str) -> Result<f64> {
    if value.is_finite() && (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(Error::invalid(what, format!("{value} {unit} is not between {low} and {high} {unit}")))
}
