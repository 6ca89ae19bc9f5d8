//! The robots of a scene: arms, the ports they work through, and what they hold.

use crate::Start;
use glam::DQuat;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use trocar_core::Pose;

/// Name of the built-in arm model.
pub const FRANKA_FR3: &str = "franka_fr3";

/// What an arm's `shapes` says for shapes without a description.
pub(crate) const SIMPLE: &str = "simple";

/// Where something is and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Frame {
    /// Origin (m).
    pub position_m: [f64; 3],
    /// Unit quaternion, scalar first.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl Default for Frame {
    fn default() -> Self {
        Self { position_m: [0.0; 3], rotation_wxyz: no_rotation() }
    }
}

impl Frame {
    /// That of `pose`.
    pub fn of(pose: &Pose) -> Self {
        let q = pose.rotation;
        Self { position_m: pose.translation.to_array(), rotation_wxyz: [q.w, q.x, q.y, q.z] }
    }

    /// As a pose; the quaternion is normalised (checked scenes have it within 1e-4 of a unit).
    pub fn pose(&self) -> Pose {
        let [w, x, y, z] = self.rotation_wxyz;
        Pose { rotation: DQuat::from_xyzw(x, y, z, w).normalize(), translation: self.position_m.into() }
    }
}

/// The side on which an arm stands. The left arm comes first in actions and observations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// At negative x.
    Left,
    /// At positive x.
    Right,
}

impl Side {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// One arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// left or right.
    pub name: Side,
    /// What moves the instrument: dynamics (joint torques, through a port) or ideal (the tip goes
    /// where it is commanded, within the speed limits of actions; no arm is simulated).
    #[serde(default, skip_serializing_if = "Drive::is_default")]
    pub drive: Drive,
    /// franka_fr3, or a URDF (.urdf) or MJCF (.xml, .mjcf) file relative to the scene file.
    #[serde(default = "franka_fr3")]
    pub model: String,
    /// The link or body in a model file on which the instrument is mounted; the last one if left
    /// out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flange: Option<String>,
    /// What it looks like in pictures: simple, or a URDF or MJCF file relative to the scene file
    /// whose visual meshes are drawn; if left out, those of a model file, and simple shapes for
    /// franka_fr3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shapes: Option<String>,
    /// Pose of the base in the cell frame. An ideal arm has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Frame>,
    /// Joint angles towards which the elbow is drawn (degrees), as many as the arm has joints; the
    /// model's own if left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub posture_deg: Vec<f64>,
    /// What drives it.
    #[serde(default)]
    pub controller: Controller,
    /// Name of the port that it works through. An ideal arm may have none: it then moves freely and
    /// has no RCM.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<String>,
    /// Direction of the shaft of an arm without a port, towards its tip; straight down if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// Name of the instrument that it holds.
    pub instrument: String,
    /// Pose of the instrument in the port when an episode starts.
    #[serde(default)]
    pub start: Start,
}

fn franka_fr3() -> String {
    FRANKA_FR3.to_owned()
}

/// What moves an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// An arm with a controller, friction and a wrong model of itself, through a port.
    #[default]
    Dynamics,
    /// The tip goes where it is commanded, within the speed limits of actions.
    Ideal,
}

impl Drive {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The model of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArmModel<'a> {
    /// The built-in Franka FR3.
    FrankaFr3,
    /// A URDF file as the scene file names it; see [`Scene::resolve`](crate::Scene::resolve).
    Urdf(&'a str),
    /// An MJCF file, likewise.
    Mjcf(&'a str),
}

impl Arm {
    /// Its model; `None` where `model` is neither a name nor a file of a known kind, which a
    /// checked scene does not have.
    pub fn source(&self) -> Option<ArmModel<'_>> {
        let ends = |end: &str| self.model.to_ascii_lowercase().ends_with(end);
        match self.model.as_str() {
            FRANKA_FR3 => Some(ArmModel::FrankaFr3),
            file if ends(".urdf") => Some(ArmModel::Urdf(file)),
            file if ends(".xml") || ends(".mjcf") => Some(ArmModel::Mjcf(file)),
            _ => None,
        }
    }

    /// The description, relative to the scene file, whose meshes pictures show; `None` for simple
    /// shapes.
    pub fn drawn(&self) -> Option<&str> {
        match (self.shapes.as_deref(), self.source()) {
            (Some(SIMPLE), _) => None,
            // An ideal arm has no links.
            _ if self.drive == Drive::Ideal => None,
            (Some(file), _) => Some(file),
            (None, Some(ArmModel::Urdf(file) | ArmModel::Mjcf(file))) => Some(file),
            (None, _) => None,
        }
    }

    /// An ideal arm without a port: its instrument starts with the pivot of its jaw at `start_m`.
    pub fn free(name: Side, instrument: &str, start_m: [f64; 3]) -> Self {
        Self {
            name,
            drive: Drive::Ideal,
            model: franka_fr3(),
            flange: None,
            shapes: None,
            base: None,
            posture_deg: Vec::new(),
            controller: Controller::default(),
            port: None,
            direction: None,
            instrument: instrument.to_owned(),
            start: Start { position_m: Some(start_m), jaw: 1.0, ..Start::default() },
        }
    }

    /// An FR3 on its side of the paper's cell, facing the phantom.
    pub(crate) fn paper(name: Side, x: f64, instrument: &str, start: Start) -> Self {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        Self {
            name,
            model: franka_fr3(),
            drive: Drive::Dynamics,
            flange: None,
            shapes: None,
            base: Some(Frame { position_m: [x, 0.0, 0.0], rotation_wxyz: [half, 0.0, 0.0, half] }),
            posture_deg: Vec::new(),
            controller: Controller::default(),
            port: Some(name.name().to_owned()),
            direction: None,
            instrument: instrument.to_owned(),
            start,
        }
    }
}

/// A controller by name, with changed gains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Controller {
    /// Its name; `default` is the one that the arm's model comes with.
    pub name: String,
    /// Gains by name, 0 or more; those left out are the controller's own. Units are the
    /// controller's.
    pub gains: BTreeMap<String, f64>,
}

impl Default for Controller {
    fn default() -> Self {
        Self { name: "default".to_owned(), gains: BTreeMap::new() }
    }
}

/// Kinds of instruments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InstrumentKind {
    /// Its jaws hold tissue.
    Grasper,
    /// Its jaws cut tissue.
    Cutter,
}

/// An instrument: a straight shaft with two blades at its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instrument {
    /// Name.
    pub name: String,
    /// grasper or cutter.
    pub kind: InstrumentKind,
    /// Diameter of the shaft (mm).
    #[serde(default = "shaft_diameter")]
    pub shaft_diameter_mm: f64,
    /// Length from the mount to the pivot of the jaw (mm).
    #[serde(default = "shaft_length")]
    pub shaft_length_mm: f64,
    /// Length of the blades beyond the pivot (mm).
    #[serde(default = "blade_length")]
    pub blade_length_mm: f64,
    /// Mass with its motor (kg); the paper's weighs 4.7 N.
    #[serde(default = "instrument_mass")]
    pub mass_kg: f64,
    /// Centre of mass from the mount, along the instrument's axes; z runs along the shaft towards
    /// the tip (mm).
    #[serde(default = "centre_of_mass")]
    pub centre_of_mass_mm: [f64; 3],
    /// Full angle between the open blades (degrees).
    #[serde(default = "jaw_max_angle")]
    pub jaw_max_angle_deg: f64,
    /// Force with which the jaws close (N); 0.5 if left out, for a cutter too. The paper's cutter
    /// has 20.
    #[serde(default = "jaw_force")]
    pub jaw_force_n: f64,
    /// Pose of the mount in the flange's frame.
    #[serde(default)]
    pub mount: Frame,
}

fn shaft_diameter() -> f64 {
    5.0
}

fn shaft_length() -> f64 {
    300.0
}

fn blade_length() -> f64 {
    21.0
}

fn instrument_mass() -> f64 {
    0.4793
}

fn centre_of_mass() -> [f64; 3] {
    [0.0, 0.0, 60.0]
}

fn jaw_max_angle() -> f64 {
    60.0
}

fn jaw_force() -> f64 {
    0.5
}

/// Force of the paper's cutter (N). Tissue between blades stiffens without end as they close, so a
/// grasper's half a newton stops short of closed in thick or stiff tissue; laparoscopic scissors
/// close with tens.
const CUTTER_FORCE_N: f64 = 20.0;

impl Instrument {
    /// The paper's instrument of that kind.
    pub fn of(kind: InstrumentKind) -> Self {
        let name = match kind {
            InstrumentKind::Grasper => "grasper",
            InstrumentKind::Cutter => "cutter",
        };
        Self {
            name: name.to_owned(),
            kind,
            shaft_diameter_mm: shaft_diameter(),
            shaft_length_mm: shaft_length(),
            blade_length_mm: blade_length(),
            mass_kg: instrument_mass(),
            centre_of_mass_mm: centre_of_mass(),
            jaw_max_angle_deg: jaw_max_angle(),
            jaw_force_n: match kind {
                InstrumentKind::Grasper => jaw_force(),
                InstrumentKind::Cutter => CUTTER_FORCE_N,
            },
            mount: Frame::default(),
        }
    }

    /// From the mount to the tip of the closed blades (m).
    pub fn length(&self) -> f64 {
        1e-3 * (self.shaft_length_mm + self.blade_length_mm)
    }
}

/// Errors of the controllers' model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GravityError {
    /// Share by which the model's links are too light.
    pub link_mass_share: f64,
    /// Share by which the model's instrument is too light.
    pub instrument_mass_share: f64,
    /// Coulomb friction in each joint that the controller knows nothing of (N m).
    pub joint_friction_nm: f64,
}

impl Default for GravityError {
    fn default() -> Self {
        Self { link_mass_share: 0.02, instrument_mass_share: 0.05, joint_friction_nm: 0.2 }
    }
}
