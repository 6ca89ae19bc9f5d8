//! The task of an episode, the gates of its stages, and safety limits.

use crate::{Abort, ScriptStep, Stage, StageOrder, TaskName};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Grasp designs by name; they are those of the cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GraspDesignName {
    /// Friction between jaws that close, and nothing else.
    Friction,
    /// Offsets as authored in the undeformed organ.
    RestPose,
    /// Offsets captured where the tissue is.
    LivePose,
    /// The same, through a spring that slips and tears.
    #[default]
    Compliant,
}

/// The task of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Task {
    /// appendix-resection, grasp-lift, port-reach, or the name of a task whose stages stand here.
    pub name: TaskName,
    /// The organ it is about.
    pub organ: String,
    /// Maximum duration of an episode (s).
    pub episode_s: f64,
    /// How the grasper holds: friction, rest-pose, live-pose or compliant.
    pub grasp: GraspDesignName,
    /// How the first grasp of an episode holds, where that differs from `grasp`: for tissue that is
    /// dragged aside, let go of and grasped again.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_grasp: Option<GraspDesignName>,
    /// A cut parts the tissue.
    pub sever: bool,
    /// The episode ends when its last stage has passed. Without, it runs until its time is up or
    /// the policy has finished.
    #[serde(skip_serializing_if = "is_true")]
    pub stop_when_passed: bool,
    /// What policies are asked for, in words, with {organ}, {grasper} and {cutter}; the built-in
    /// task's if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prompt: Option<String>,
    /// In which order the task's own stages pass: listed or any.
    #[serde(skip_serializing_if = "StageOrder::is_listed")]
    pub order: StageOrder,
    /// When stages count as done: `gates.lift_mm` and so on in expressions.
    pub gates: Gates,
    /// Numbers of the task's own for its expressions, such as `constants.aside_mm`. A name ends in
    /// its unit.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<String, f64>,
    /// The stages; those of the built-in task if left out.
    #[serde(rename = "stage", skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// What ends an episode as failed.
    #[serde(rename = "abort", skip_serializing_if = "Vec::is_empty")]
    pub aborts: Vec<Abort>,
    /// The steps of the scripted baseline of a task of one's own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub script: Vec<ScriptStep>,
}

impl Default for Task {
    fn default() -> Self {
        Self {
            name: TaskName::default(),
            organ: "appendix".to_owned(),
            episode_s: 40.0,
            grasp: GraspDesignName::default(),
            first_grasp: None,
            sever: false,
            stop_when_passed: true,
            prompt: None,
            order: StageOrder::default(),
            gates: Gates::default(),
            constants: BTreeMap::new(),
            stages: Vec::new(),
            aborts: Vec::new(),
            script: Vec::new(),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_true(value: &bool) -> bool {
    *value
}

/// When the stages of the resection count as done, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gates {
    /// Grasp: attached at this organ coordinate or beyond.
    pub grasp_from: f64,
    /// Grasp: and at this one or before.
    pub grasp_to: f64,
    /// Lift: the held cluster's centroid rises by this much (mm) ...
    pub lift_mm: f64,
    /// ... for this long (s).
    pub lift_s: f64,
    /// Positioning: the cutter's tip is this near to the tissue between grasp and base (mm).
    pub positioning_mm: f64,
    /// Cut: the jaw first opens beyond this (0 closed to 1) ...
    pub cut_open: f64,
    /// ... then closes below this, with tissue in the mouth all the while.
    pub cut_closed: f64,
}

impl Default for Gates {
    fn default() -> Self {
        Self {
            grasp_from: 0.30,
            grasp_to: 0.70,
            lift_mm: 8.0,
            lift_s: 0.5,
            positioning_mm: 10.0,
            cut_open: 0.50,
            cut_closed: 0.15,
        }
    }
}

/// Safety limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Safety {
    /// RCM deviation that episodes are scored against (mm).
    pub rcm_threshold_mm: f64,
    /// RCM deviation at which the hardware stops (mm).
    pub rcm_abort_mm: f64,
    /// Force of tissue on an instrument against which no command pushes it on (N).
    pub force_limit_n: f64,
    /// An instrument that comes through the surface of an organ punctures it if it pressed on it
    /// with at least this force (N).
    pub puncture_force_n: f64,
    /// What the force guard watches; all by default.
    pub rules: SafetyRules,
}

impl Default for Safety {
    fn default() -> Self {
        Self {
            rcm_threshold_mm: 3.0,
            rcm_abort_mm: 5.0,
            force_limit_n: 10.0,
            puncture_force_n: 10.0,
            rules: SafetyRules::default(),
        }
    }
}

/// What the force guard of a cell watches. It stops arms; no rule changes the physics of tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SafetyRules {
    /// A command is shortened where tissue pushes back with `force_limit_n`.
    pub force_guard: bool,
    /// An arm also stops where its instrument strains tissue nearly beyond what tissue withstands.
    pub strain_guard: bool,
}

impl Default for SafetyRules {
    fn default() -> Self {
        Self { force_guard: true, strain_guard: true }
    }
}
