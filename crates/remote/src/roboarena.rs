//! The requirements of a RoboArena server: the fields of `PolicyServerConfig` in
//! github.com/robo-arena/roboarena, which it sends as its metadata. Missing fields have the
//! defaults of that class.

use crate::error::{Error, Result};
use crate::value::{Map, Value};

/// The observations that a RoboArena server needs, and its actions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerConfig {
    /// Height and width of pictures (px); `None` leaves them as they are.
    pub image_resolution: Option<[usize; 2]>,
    /// Whether it needs `observation/wrist_image_left`.
    pub needs_wrist_camera: bool,
    /// Number of `observation/exterior_image_{i}_left` that it needs, in [0, 2].
    pub n_external_cameras: usize,
    /// Whether it needs the right pictures too.
    pub needs_stereo_camera: bool,
    /// Whether it needs `session_id`.
    pub needs_session_id: bool,
    /// `joint_position`, `joint_velocity`, `cartesian_position` or `cartesian_velocity`.
    pub action_space: String,
}

impl ServerConfig {
    /// Whether the metadata are those of a RoboArena server.
    pub fn is_in(metadata: &Map) -> bool {
        ["image_resolution", "needs_wrist_camera", "n_external_cameras"].iter().all(|k| metadata.contains_key(*k))
    }

    /// Reads the metadata of a RoboArena server. Other fields are ignored.
    ///
    /// # Errors
    /// [`Error::WrongField`] for a field of another kind.
    pub fn from_metadata(metadata: &Map) -> Result<Self> {
        let wrong = |at: &str, wanted: &str| Error::WrongField { at: at.into(), reason: format!("must be {wanted}") };
        let truth = |key: &str, default| match metadata.get(key) {
            None => Ok(default),
            Some(Value::Bool(value)) => Ok(*value),
            Some(_) => Err(wrong(key, "true or false")),
        };
        let side = |value: &Value| match value {
            Value::Int(n) if (1..=16384).contains(n) => Some(*n as usize),
            _ => None,
        };
        let image_resolution = match metadata.get("image_resolution") {
            None => Some([224, 224]),
            Some(Value::Nil) => None,
            Some(Value::List(sides)) if sides.len() == 2 => match (side(&sides[0]), side(&sides[1])) {
                (Some(height), Some(width)) => Some([height, width]),
                _ => return Err(wrong("image_resolution", "height and width in [1, 16384]")),
            },
            Some(_) => return Err(wrong("image_resolution", "height and width, or null")),
        };
        let n_external_cameras = match metadata.get("n_external_cameras") {
            None => 1,
            Some(Value::Int(n @ 0..=2)) => *n as usize,
            Some(_) => return Err(wrong("n_external_cameras", "0, 1 or 2")),
        };
        let action_space = match metadata.get("action_space") {
            None => "joint_position".to_owned(),
            Some(Value::Text(name)) => name.clone(),
            Some(_) => return Err(wrong("action_space", "a name")),
        };
        Ok(Self {
            image_resolution,
            needs_wrist_camera: truth("needs_wrist_camera", true)?,
            n_external_cameras,
            needs_stereo_camera: truth("needs_stereo_camera", false)?,
            needs_session_id: truth("needs_session_id", false)?,
            action_space,
        })
    }

    /// Number of components of an action, gripper included: 8 for joints, 7 for a pose, `None` for
    /// an unknown action space.
    pub fn action_dim(&self) -> Option<usize> {
        match self.action_space.as_str() {
            "joint_position" | "joint_velocity" => Some(8),
            "cartesian_position" | "cartesian_velocity" => Some(7),
            _ => None,
        }
    }
}
