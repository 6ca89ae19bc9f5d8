//! What can go wrong in a study.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// A study that cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The parts of the input do not belong together.
    #[error("{0}")]
    Mismatch(String),
    /// A file is in the way.
    #[error("{path} {reason}", path = path.display())]
    Exists {
        /// The file.
        path: PathBuf,
        /// Why it stays.
        reason: String,
    },
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
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
    /// A part of the product failed.
    #[error(transparent)]
    Work(trocar_workflow::Error),
    /// A scene of tissue cannot be made or stepped.
    #[error(transparent)]
    TissueScene(#[from] trocar_testing::scenes::Error),
    /// The oracle or a comparator failed.
    #[error(transparent)]
    Reference(#[from] trocar_tissue_reference::Error),
    /// Two pictures cannot be compared.
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

/// Errors that the product has a name for.
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
