//! Errors of the cell.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// An error of the cell.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The specimen has no organ of that name.
    #[error("no organ '{name}' in the specimen; it has {known}")]
    UnknownOrgan {
        /// The requested name.
        name: String,
        /// The known names.
        known: String,
    },
    /// An option is out of range, or no tissue can be grasped there.
    #[error("{0}")]
    Option(String),
    /// A number of an action is refused. The cell is unchanged.
    #[error("action[{index}], {name}, {reason}")]
    Action {
        /// Its place in the action.
        index: usize,
        /// Its name.
        name: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The cell has no arm of that name.
    #[error("no arm '{name}' in the cell; it has {known}")]
    UnknownArm {
        /// The requested name.
        name: String,
        /// The known names.
        known: String,
    },
    /// A field of the scene cannot be built.
    #[error("{scene}: {field} {reason}")]
    Scene {
        /// The scene's file or name, see [`trocar_scene::Scene::label`].
        scene: String,
        /// The field.
        field: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// An arm, an instrument or a port is unusable.
    #[error(transparent)]
    Robot(#[from] trocar_robot::Error),
    /// The user asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The model cannot be built.
    #[error(transparent)]
    Tissue(#[from] trocar_tissue::Error),
    /// A mesh is unusable.
    #[error(transparent)]
    Geometry(#[from] trocar_geometry::Error),
    /// The specimen is unusable.
    #[error(transparent)]
    Specimen(#[from] trocar_specimen::Error),
}
