//! Errors of measurements.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A film that cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A frame cannot be read.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// The instruments of a frame cannot be found.
    #[error(transparent)]
    Segment(#[from] trocar_segment::Error),
    /// A frame of another source cannot be made.
    #[error("{0}")]
    Film(String),
    /// The organ in the frame at rest cannot be used.
    #[error("frame {frame}: {reason}")]
    Organ {
        /// The frame at rest.
        frame: usize,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The user interrupted the measurement.
    #[error("interrupted")]
    Interrupted,
}
