//! What can go wrong while results and reports are made.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A result or report that cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The parts of the input do not belong together (sizes or counts differ).
    #[error("{0}")]
    Mismatch(String),
    /// The recording's truth does not fit the recording.
    #[error("{path}: {reason}", path = path.display())]
    Truth {
        /// The file.
        path: PathBuf,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A file is in the way.
    #[error("{path} {reason}", path = path.display())]
    Exists {
        /// The file.
        path: PathBuf,
        /// Why it stays.
        reason: String,
    },
    /// A moving picture has no frames.
    #[error("the moving picture has no frames")]
    NoFrames,
    /// An image or camera is unusable.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// The output would replace or change the input.
    #[error("the output {output} and the input {input} lie in one another; name a folder beside it", output = output.display(), input = input.display())]
    Overlap {
        /// The input.
        input: PathBuf,
        /// The output.
        output: PathBuf,
    },
    /// Something does not fit on the renderer's stage.
    #[error(transparent)]
    Render(#[from] trocar_render::Error),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The user asked a campaign to stop.
    #[error(
        "interrupted; {kept} of {planned} episodes are kept, with their table and report; the same command goes on"
    )]
    Stopped {
        /// Episodes that are kept.
        kept: usize,
        /// Episodes that are to be in all.
        planned: usize,
    },
    /// A result cannot be written down.
    #[error("the result cannot be written: {0}")]
    Format(String),
    /// A file cannot be written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// A phantom cannot be recorded.
    #[error(transparent)]
    Phantom(#[from] trocar_phantom::Error),
    /// A recording or surface cannot be reconstructed.
    #[error(transparent)]
    Reconstruct(#[from] trocar_reconstruct::Error),
    /// A recording is unusable.
    #[error(transparent)]
    Recording(#[from] trocar_recording::Error),
    /// A port, an instrument or a measurement of force is unusable.
    #[error(transparent)]
    Robot(#[from] trocar_robot::Error),
    /// Something cannot be found in a picture.
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
    /// A camera of the cell cannot see.
    #[error(transparent)]
    Sensors(#[from] trocar_sensors::Error),
    /// A task cannot be run.
    #[error(transparent)]
    Cell(trocar_cell::Error),
}

/// What was interrupted inside is interrupted outside.
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
