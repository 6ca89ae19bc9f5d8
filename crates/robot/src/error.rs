//! What can go wrong with a description of the robot or with what is asked of it.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A description or measurement that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A value is out of range or not finite.
    #[error("{what}: {reason}")]
    Invalid {
        /// The thing and its field.
        what: String,
        /// What is wrong and what would be right.
        reason: String,
    },
}

impl Error {
    /// [`Error::Invalid`] of `what` for `reason`.
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
