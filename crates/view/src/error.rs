//! Errors of the viewer.

use std::path::PathBuf;

/// Errors of the viewer.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The server cannot listen.
    #[error("port {port}: {reason}; choose another with --port, or 0 for a free one")]
    Listen {
        /// The port.
        port: u16,
        /// Why.
        reason: String,
    },
    /// A file or folder.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The requested source cannot be shown; the text names those that can.
    #[error("{0}")]
    Source(String),
    /// A connection to a server ended.
    #[error("the connection to the viewer ended: {0}")]
    Connection(String),
    /// From the cell.
    #[error(transparent)]
    Cell(#[from] trocar_cell::Error),
    /// From the renderer's cameras.
    #[error(transparent)]
    Sensors(#[from] trocar_sensors::Error),
    /// From pictures.
    #[error(transparent)]
    Camera(#[from] trocar_camera::Error),
    /// From a scene.
    #[error(transparent)]
    Scene(#[from] trocar_scene::Error),
    /// From an episode.
    #[error(transparent)]
    Task(#[from] trocar_task::Error),
    /// From the commands' work.
    #[error(transparent)]
    Workflow(#[from] trocar_workflow::Error),
}

/// Result with this crate's error.
pub type Result<T> = std::result::Result<T, Error>;
