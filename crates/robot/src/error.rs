//! Errors of arms and instruments.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An invalid arm or instrument, or a motion that cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be opened or read.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// A description file is invalid.
    #[error("{path}: {reason}", path = path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// The element, what is wrong with it and the remedy.
        reason: String,
    },
    /// A value is out of range.
    #[error("{what}: {reason}")]
    Invalid {
        /// The object and its field.
        what: String,
        /// The reason and the remedy.
        reason: String,
    },
    /// A number is not finite. The state is unchanged.
    #[error("{what} is not finite")]
    NotFinite {
        /// The number.
        what: &'static str,
    },
}

impl Error {
    /// A value out of range.
    pub(crate) fn invalid(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Invalid { what: what.into(), reason: reason.into() }
    }
}

/// `value`, if it is in [`low`, `high`]. `what` and `unit` are for the message.
pub(crate) fn within(what: &str, value: f64, low: f64, high: f64, unit: &str) -> Result<f64> {
    if value.is_finite() && (low..=high).contains(&value) {
        return Ok(value);
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Err(Error::invalid(what, format!("is {value}{unit}; it must be in [{low}, {high}]{unit}")))
}
