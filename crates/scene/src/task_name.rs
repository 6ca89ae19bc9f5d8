//! Names of tasks: those that come with the program, and scenes' own.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Longest name of a task (bytes).
const MAX_NAME: usize = 40;

/// Tasks by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum TaskName {
    /// Grasp, lift, positioning, jaw on tissue, cut.
    #[default]
    AppendixResection,
    /// Grasp and lift with one arm.
    GraspLift,
    /// Free motion of the instruments in their ports.
    PortReach,
    /// A scene's own.
    Own(OwnName),
}

/// The name of a scene's own task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnName {
    bytes: [u8; MAX_NAME],
    length: usize,
}

impl TaskName {
    /// The task of that name.
    ///
    /// # Errors
    /// A name that is not 1 to 40 lower-case letters, digits, `-` and `_`.
    pub fn new(name: &str) -> Result<Self, String> {
        if let Some(builtin) =
            [Self::AppendixResection, Self::GraspLift, Self::PortReach].iter().find(|t| t.name() == name)
        {
            return Ok(*builtin);
        }
        let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(legal) {
            let shown: String = name.chars().take(60).flat_map(char::escape_default).collect();
            return Err(format!("is '{shown}'; it must be 1 to {MAX_NAME} lower-case letters, digits, '-' and '_'"));
        }
        let mut bytes = [0; MAX_NAME];
        bytes[..name.len()].copy_from_slice(name.as_bytes());
        Ok(Self::Own(OwnName { bytes, length: name.len() }))
    }

    /// As it is written.
    pub fn name(&self) -> &str {
        match self {
            Self::AppendixResection => "appendix-resection",
            Self::GraspLift => "grasp-lift",
            Self::PortReach => "port-reach",
            // Only ASCII is put in.
            Self::Own(own) => std::str::from_utf8(&own.bytes[..own.length]).unwrap_or_default(),
        }
    }
}

impl TryFrom<String> for TaskName {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::new(&name)
    }
}

impl From<TaskName> for String {
    fn from(name: TaskName) -> Self {
        name.name().to_owned()
    }
}

impl JsonSchema for TaskName {
    fn schema_name() -> Cow<'static, str> {
        "TaskName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A built-in task, or the name of a task whose stages stand in the scene.",
            "type": "string",
            "pattern": "^[a-z0-9_-]{1,40}$",
            "examples": ["appendix-resection", "grasp-lift", "port-reach"],
        })
    }
}
