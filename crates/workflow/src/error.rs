//! Errors of the commands.

use std::path::PathBuf;
use trocar_core::Progress;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A result or report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An input or option is wrong.
    #[error("{0}")]
    Mismatch(String),
    /// A file or folder exists and is not overwritten.
    #[error("{path} {reason}", path = path.display())]
    Exists {
        /// The file.
        path: PathBuf,
        /// Why it is not overwritten.
        reason: String,
    },
    /// A video has no frames.
    #[error("the video has no frames")]
    NoFrames,
    /// An image or camera is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// Two pictures cannot be compared.
    #[error(transparent)]
    Similarity(#[from] trocar_camera::metrics::Error),
    /// The output would replace or change the input.
    #[error("the output folder {output} overlaps the input {input}; choose another output folder", output = output.display(), input = input.display())]
    Overlap {
        /// The input.
        input: PathBuf,
        /// The output.
        output: PathBuf,
    },
    /// A scene cannot be rendered.
    #[error(transparent)]
    Render(#[from] trocar_render::Error),
    /// The user interrupted the work.
    #[error("interrupted")]
    Interrupted,
    /// The user interrupted a campaign.
    #[error(
        "interrupted; {kept} of {planned} episodes are finished, with their table and report; the same command continues"
    )]
    Stopped {
        /// Number of finished episodes.
        kept: usize,
        /// Number of episodes of the whole campaign.
        planned: usize,
    },
    /// A lift cannot be measured.
    #[error(transparent)]
    Measure(trocar_measure::Error),
    /// Nothing can be identified from lifts.
    #[error(transparent)]
    Identify(trocar_identify::Error),
    /// A step of a study failed.
    #[error(transparent)]
    Study(Box<dyn std::error::Error + Send + Sync>),
    /// A result cannot be serialised.
    #[error("the result cannot be written: {0}")]
    Format(String),
    /// A file cannot be written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// A phantom cannot be recorded.
    #[error(transparent)]
    Phantom(trocar_phantom::Error),
    /// A recording or surface cannot be reconstructed.
    #[error(transparent)]
    Reconstruct(trocar_reconstruct::Error),
    /// A recording is unusable.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// A port, an instrument or a measurement of force is unusable.
    #[error(transparent)]
    Robot(#[from] trocar_robot::Error),
    /// A picture cannot be segmented.
    #[error(transparent)]
    Segment(#[from] trocar_segment::Error),
    /// A page cannot be drawn.
    #[error(transparent)]
    Report(#[from] trocar_report::Error),
    /// A scene cannot be read or written.
    #[error(transparent)]
    Scene(#[from] trocar_scene::Error),
    /// A specimen cannot be read or written.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
    /// A model cannot be built or stepped.
    #[error(transparent)]
    Tissue(#[from] trocar_tissue::Error),
    /// An episode cannot be run, or its files are unusable.
    #[error(transparent)]
    Task(trocar_task::Error),
    /// A camera of the cell cannot render.
    #[error(transparent)]
    Sensors(#[from] trocar_sensors::Error),
    /// A cell cannot be built or stepped.
    #[error(transparent)]
    Cell(trocar_cell::Error),
}

/// Stops interrupted work.
///
/// # Errors
/// [`Error::Interrupted`] if the user asked to stop.
pub fn check_interrupted(progress: &dyn Progress) -> Result<()> {
    if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
}

/// Keeps interruptions apart from other errors.
impl From<trocar_phantom::Error> for Error {
    fn from(error: trocar_phantom::Error) -> Self {
        match error {
            trocar_phantom::Error::Interrupted => Self::Interrupted,
            other => Self::Phantom(other),
        }
    }
}

/// Keeps interruptions apart from other errors.
impl From<trocar_measure::Error> for Error {
    fn from(error: trocar_measure::Error) -> Self {
        match error {
            trocar_measure::Error::Interrupted => Self::Interrupted,
            other => Self::Measure(other),
        }
    }
}

/// Keeps interruptions apart from other errors.
impl From<trocar_identify::Error> for Error {
    fn from(error: trocar_identify::Error) -> Self {
        match error {
            trocar_identify::Error::Interrupted => Self::Interrupted,
            other => Self::Identify(other),
        }
    }
}

impl From<trocar_reconstruct::Error> for Error {
    fn from(error: trocar_reconstruct::Error) -> Self {
        match error {
            trocar_reconstruct::Error::Interrupted => Self::Interrupted,
            other => Self::Reconstruct(other),
        }
    }
}

/// Keeps interruptions apart from other errors.
impl From<trocar_cell::Error> for Error {
    fn from(error: trocar_cell::Error) -> Self {
        match error {
            trocar_cell::Error::Interrupted => Self::Interrupted,
            other => Self::Cell(other),
        }
    }
}

impl From<trocar_task::Error> for Error {
    fn from(error: trocar_task::Error) -> Self {
        match error {
            trocar_task::Error::Cell(inner) => inner.into(),
            other => Self::Task(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interruptions_are_one_error_wherever_the_work_stopped() {
        for error in [
            Error::from(trocar_phantom::Error::Interrupted),
            Error::from(trocar_reconstruct::Error::Interrupted),
            Error::from(trocar_cell::Error::Interrupted),
        ] {
            assert!(matches!(error, Error::Interrupted), "{error:?}");
        }
    }
}
