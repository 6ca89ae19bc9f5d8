//! Errors of studies.

use std::path::PathBuf;

/// The result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An error of a study.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Invalid options or inputs.
    #[error("{0}")]
    Mismatch(String),
    /// A file or folder that exists and is not overwritten.
    #[error("{path} {reason}", path = path.display())]
    Exists {
        /// The path.
        path: PathBuf,
        /// Why it is not overwritten.
        reason: String,
    },
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// A result that cannot be converted to JSON or text.
    #[error("the result cannot be written: {0}")]
    Format(String),
    /// A file that cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// An error of another crate.
    #[error(transparent)]
    Work(trocar_workflow::Error),
    /// A tissue scene that cannot be built or stepped.
    #[error(transparent)]
    TissueScene(#[from] crate::scenes::Error),
    /// An error of the oracle or of a comparator.
    #[error(transparent)]
    Reference(#[from] trocar_tissue_reference::Error),
    /// Two pictures that cannot be compared.
    #[error(transparent)]
    Similarity(#[from] trocar_camera::metrics::Error),
}

impl From<trocar_workflow::Error> for Error {
    fn from(error: trocar_workflow::Error) -> Self {
        match error {
            trocar_workflow::Error::Interrupted => Self::Interrupted,
            other => Self::Work(other),
        }
    }
}

/// Errors that `trocar_workflow::Error` wraps.
macro_rules! through_work {
    ($($crate_name:ident),*) => {
        $(impl From<$crate_name::Error> for Error {
            fn from(error: $crate_name::Error) -> Self {
                trocar_workflow::Error::from(error).into()
            }
        })*
    };
}

through_work!(
    trocar_camera,
    trocar_cell,
    trocar_geometry,
    trocar_phantom,
    trocar_reconstruct,
    trocar_recording,
    trocar_render,
    trocar_report,
    trocar_robot,
    trocar_scene,
    trocar_sensors,
    trocar_specimen,
    trocar_task,
    trocar_tissue
);
