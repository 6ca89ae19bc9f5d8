//! A task's stages as text, in scene files and in the built-in tasks.

use crate::{Error, Result, Side, TaskName};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use trocar_specimen::parse_toml;

/// A stage of a task.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Its name: lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// When it passes: a condition on channels, such as `lift_mm >= 8 for 0.5 s`.
    pub when: String,
    /// Its part of the score, relative to the other stages'.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub share: f64,
    /// How far it is before it passes, a number from 0 to 1; without, the share of its `for` that
    /// has passed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub progress: Option<String>,
    /// What is said where an episode ends before it, with numbers as `{most(lift_mm):.1}`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hint: Option<String>,
}

fn one() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// What ends an episode as failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Abort {
    /// Its name: lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// When: a condition as of stages, such as `force(left) > 2 N`.
    pub when: String,
}

/// In which order stages pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StageOrder {
    /// One after the other, as they are listed.
    #[default]
    Listed,
    /// In any order.
    Any,
}

impl StageOrder {
    pub(crate) fn is_listed(&self) -> bool {
        *self == Self::Listed
    }
}

/// A step of a task's scripted baseline: one of `grasp`, `move_mm` and `release`; without any it
/// waits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScriptStep {
    /// The arm: left or right.
    pub arm: Side,
    /// Takes hold of this part of an organ, such as `organ.cecum[0.4, 0.6]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grasp: Option<String>,
    /// Moves the tip by this much along the cell's axes (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub move_mm: Option<[f64; 3]>,
    /// Opens the jaws and draws back.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub release: bool,
    /// How long a move or a wait takes (s); without, as the way needs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// A move or a wait ends as soon as this condition holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<String>,
}

/// A task as text: what it asks for, and when that is done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// One line of what is done.
    #[serde(default)]
    pub summary: String,
    /// What policies are asked for, in words.
    #[serde(default)]
    pub prompt: String,
    /// In which order stages pass.
    #[serde(default)]
    pub order: StageOrder,
    /// The stages.
    #[serde(rename = "stage")]
    pub stages: Vec<Stage>,
    /// What ends an episode as failed.
    #[serde(default, rename = "abort")]
    pub aborts: Vec<Abort>,
    /// The steps of its scripted baseline.
    #[serde(default)]
    pub script: Vec<ScriptStep>,
}

/// A task that comes with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltinTask {
    /// Its name.
    pub name: TaskName,
    /// The file, with comments.
    pub text: &'static str,
}

/// The built-in tasks.
pub const BUILTIN_TASKS: [BuiltinTask; 3] = [
    BuiltinTask { name: TaskName::AppendixResection, text: include_str!("../tasks/appendix-resection.toml") },
    BuiltinTask { name: TaskName::GraspLift, text: include_str!("../tasks/grasp-lift.toml") },
    BuiltinTask { name: TaskName::PortReach, text: include_str!("../tasks/port-reach.toml") },
];

impl BuiltinTask {
    /// The built-in task of that name.
    pub fn named(name: TaskName) -> Option<&'static Self> {
        BUILTIN_TASKS.iter().find(|b| b.name == name)
    }

    /// What its file says.
    ///
    /// # Errors
    /// None in a program that passed its tests.
    pub fn definition(&self) -> Result<Definition> {
        parse_toml(self.text).map_err(|reason| Error::Invalid { file: self.name.name().to_owned(), reason })
    }
}
