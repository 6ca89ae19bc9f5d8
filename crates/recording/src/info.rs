//! The contents of `recording.toml`.

use crate::error::{Error, Result};
use crate::lift::LiftInfo;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::{Component, Path};
use trocar_camera::Camera;
use trocar_specimen::{Material, Pins};

/// The file whose presence makes a folder a recording.
pub(crate) const MARKER: &str = "recording.toml";

/// Facts of a recording. Cameras and depth scale may be left out where a bag or MCAP file has them;
/// given ones override the file's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingInfo {
    /// Name of the recording.
    pub name: String,
    /// Frames per second; required for folders of images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Unit of the depth images (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_scale_m: Option<f64>,
    /// Unit vector against gravity in the camera frame; [0, 0, -1] for a camera that looks straight
    /// down.
    pub up: [f64; 3],
    /// Added to a depth pixel (u, v) to reach its colour pixel (px), for depth that is not
    /// registered and whose camera is unknown.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub depth_offset_px: [f64; 2],
    /// Largest valid depth (m); no limit by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_max_m: Option<f64>,
    /// How instruments are found; by default by their masks, where there are any.
    #[serde(default, skip_serializing_if = "InstrumentRule::is_masks")]
    pub instruments: InstrumentRule,
    /// Free text: sources of the numbers, and which of them are estimates.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Log file of the frames; the folders of images by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceInfo>,
    /// The camera of the colour images, to whose pixels everything is registered. Where depth is
    /// registered already, or is alone, its camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// The camera of the depth images where it is another one; depth is then registered to colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_camera: Option<Camera>,
    /// From the depth camera's frame to the colour camera's; required with `depth_camera`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_to_color: Option<DepthToColor>,
    /// Instruments that a segmenter follows through the frames.
    #[serde(default, rename = "instrument", skip_serializing_if = "Vec::is_empty")]
    pub followed: Vec<InstrumentInfo>,
    /// The organs to reconstruct.
    #[serde(default, rename = "organ", skip_serializing_if = "Vec::is_empty")]
    pub organs: Vec<OrganInfo>,
    /// The intervals in which an instrument lifts tissue.
    #[serde(default, rename = "lift", skip_serializing_if = "Vec::is_empty")]
    pub lifts: Vec<LiftInfo>,
}

/// An instrument, marked by points in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstrumentInfo {
    /// Name.
    pub name: String,
    /// The frame of the points.
    #[serde(default)]
    pub frame: usize,
    /// Pixels (u, v) on it.
    pub points: Vec<[f64; 2]>,
    /// Pixels (u, v) outside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points_outside: Vec<[f64; 2]>,
}

/// A rigid motion: p_color = rotation p_depth + translation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthToColor {
    /// Rows of the rotation matrix.
    pub rotation: [[f64; 3]; 3],
    /// Translation (m).
    pub translation_m: [f64; 3],
}

/// A log file with the frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourceInfo {
    /// A `.bag` or `.mcap` file, relative to the folder of this file.
    pub file: String,
    /// Topic of the colour images; found by name by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color_topic: Option<String>,
    /// Topic of the depth images; found by name by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_topic: Option<String>,
}

/// How the pixels of instruments are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InstrumentRule {
    /// By the masks in `masks/instruments/`, where there are any.
    #[default]
    Masks,
    /// By the appearance of metal, in every frame.
    Metal,
    /// There are no instruments.
    None,
}

impl InstrumentRule {
    fn is_masks(&self) -> bool {
        *self == Self::Masks
    }
}

fn is_zero(offset: &[f64; 2]) -> bool {
    *offset == [0.0; 2]
}

impl DepthToColor {
    /// The rotation as a matrix.
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_cols_array_2d(&self.rotation).transpose()
    }

    fn validate(&self) -> std::result::Result<(), String> {
        let m = self.matrix();
        let off = (m * m.transpose() - DMat3::IDENTITY).to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        // Calibrations are printed with at least four digits.
        if off.is_nan() || off > 5e-3 || m.determinant() < 0.0 {
            return Err(
                "depth_to_color.rotation is not a rotation; it must be the three rows of an orthonormal matrix".into(),
            );
        }
        if self.translation_m.iter().any(|t| t.is_nan() || t.abs() > 10.0) {
            return Err(format!(
                "depth_to_color.translation_m is {:?}; its numbers must be in [-10, 10] m",
                self.translation_m
            ));
        }
        Ok(())
    }
}

/// One organ of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrganInfo {
    /// Name; its mask is `masks/<name>.png` unless `polygon` or `points` is given.
    pub name: String,
    /// Outline in colour-image pixels (u, v), instead of a mask file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub polygon: Vec<[f64; 2]>,
    /// Colour-image pixels (u, v) on the organ, from which a segmenter finds its mask.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
    /// Colour-image pixels (u, v) outside the organ, for the segmenter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points_outside: Vec<[f64; 2]>,
    /// Pixel near the organ's base (organ coordinate 0); by default the end nearer to the image's
    /// centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_px: Option<[f64; 2]>,
    /// Material; the default material when absent.
    #[serde(default)]
    pub material: Material,
    /// Pins; the lowest 42% of the nodes when absent.
    #[serde(default)]
    pub pins: Pins,
}

impl RecordingInfo {
    /// Defaults for the log file `path` without a `recording.toml`: its camera looks straight down.
    pub fn of_log(path: &Path) -> Self {
        Self {
            name: path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            up: [0.0, 0.0, -1.0],
            source: path
                .file_name()
                .map(|n| SourceInfo { file: n.to_string_lossy().into_owned(), ..SourceInfo::default() }),
            ..Self::default()
        }
    }

    /// Checks every field and normalises `up`. Errors name the file `path`.
    ///
    /// # Errors
    /// Names the field, its value, and what would be right.
    pub fn validate(&mut self, path: &Path) -> Result<()> {
        let wrong = |reason: String| Err(Error::wrong(path, reason));
        if let Some(rate) = self.rate_hz
            && !(rate > 0.0 && rate <= 10_000.0)
        {
            return wrong(format!("rate_hz is {rate}; it must be in (0, 10000] frames per second"));
        }
        if let Some(scale) = self.depth_scale_m
            && !(1e-6..=0.1).contains(&scale)
        {
            return wrong(format!(
                "depth_scale_m is {scale}; the unit of the depth images must be in [1e-6, 0.1] m (0.001 for millimetres)"
            ));
        }
        self.validate_cameras().or_else(wrong)?;
        self.validate_source().or_else(wrong)?;
        let up = DVec3::from(self.up);
        match up.try_normalize() {
            // A unit vector keeps its bits.
            Some(unit) if (up.length() - 1.0).abs() > 1e-9 => self.up = unit.into(),
            Some(_) => {}
            None => {
                return wrong(format!(
                    "up is {:?}; it must be a direction, such as [0, 0, -1] for a camera that looks down",
                    self.up
                ));
            }
        }
        if self.depth_offset_px.iter().any(|o| !(-10_000.0..=10_000.0).contains(o)) {
            return wrong(format!(
                "depth_offset_px is {:?}; both numbers must be in [-10000, 10000] px",
                self.depth_offset_px
            ));
        }
        if let Some(max) = self.depth_max_m
            && (max.is_nan() || max <= 0.0)
        {
            return wrong(format!("depth_max_m is {max}; it must be above 0 (m)"));
        }
        for (i, instrument) in self.followed.iter().enumerate() {
            let points = || instrument.points.iter().chain(&instrument.points_outside).flatten();
            if instrument.points.is_empty() || points().any(|c| !c.is_finite()) {
                return wrong(format!("instrument[{i}].points needs at least one pixel [u, v] on the instrument"));
            }
        }
        for (i, lift) in self.lifts.iter().enumerate() {
            lift.validate(self.camera.as_ref()).or_else(|reason| wrong(format!("lift[{i}].{reason}")))?;
        }
        for (i, organ) in self.organs.iter().enumerate() {
            if let Err(reason) = trocar_specimen::check_name(&organ.name) {
                return wrong(format!("organ[{i}].name: {reason}"));
            }
            if organ.name == "instruments" {
                return wrong(format!(
                    "organ[{i}].name is 'instruments', which is the name of the instrument masks; choose another"
                ));
            }
            if self.organs[..i].iter().any(|o| o.name == organ.name) {
                return wrong(format!("organ[{i}].name is '{}' a second time; names must be unique", organ.name));
            }
            organ
                .validate(self.camera.as_ref())
                .or_else(|reason| wrong(format!("organ '{}': {reason}", organ.name)))?;
        }
        Ok(())
    }

    fn validate_cameras(&self) -> std::result::Result<(), String> {
        for (name, camera) in [("camera", &self.camera), ("depth_camera", &self.depth_camera)] {
            if let Some(camera) = camera {
                camera.validate().map_err(|e| e.to_string().replacen("camera", name, 1))?;
            }
        }
        match (&self.depth_camera, &self.depth_to_color) {
            (Some(_), Some(motion)) => motion.validate()?,
            (Some(_), None) => {
                return Err("depth_camera needs depth_to_color: its pose relative to the colour camera".into());
            }
            (None, Some(_)) => return Err("depth_to_color needs depth_camera".into()),
            (None, None) => {}
        }
        if self.depth_camera.is_some() && self.depth_offset_px != [0.0; 2] {
            return Err("depth_offset_px and depth_camera exclude each other; leave one out".into());
        }
        Ok(())
    }

    fn validate_source(&self) -> std::result::Result<(), String> {
        let Some(source) = &self.source else {
            // A folder of images has no cameras of its own.
            let missing = [
                (
                    "depth_scale_m",
                    self.depth_scale_m.is_none(),
                    "unit of the depth images in metres, 0.001 for millimetres",
                ),
                ("[camera]", self.camera.is_none(), "width, height, fx, fy, cx, cy of the images"),
            ];
            return match missing.into_iter().find(|m| m.1) {
                Some((name, _, what)) => Err(format!("missing field `{name}`: {what}")),
                None => Ok(()),
            };
        };
        let inside = Path::new(&source.file).components().all(|c| matches!(c, Component::Normal(_)));
        if source.file.is_empty() || !inside {
            return Err(format!(
                "source.file is '{}'; it must be a .bag or .mcap file in this folder, without '..'",
                source.file
            ));
        }
        Ok(())
    }
}

impl OrganInfo {
    fn validate(&self, camera: Option<&Camera>) -> std::result::Result<(), String> {
        let n = self.polygon.len();
        if n == 1 || n == 2 {
            return Err(format!("polygon has {n} points; it must have at least 3"));
        }
        if self.polygon.iter().flatten().any(|c| !c.is_finite()) {
            return Err("polygon has a coordinate that is not a finite number".into());
        }
        if self.points.iter().chain(&self.points_outside).flatten().any(|c| !c.is_finite()) {
            return Err("points has a coordinate that is not a finite number".into());
        }
        if let (Some([u, v]), Some(camera)) = (self.base_px, camera) {
            let (w, h) = (camera.width as f64, camera.height as f64);
            if !((0.0..w).contains(&u) && (0.0..h).contains(&v)) {
                return Err(format!("base_px is [{u}, {v}]; it must be a pixel of the {w} x {h} image"));
            }
        }
        self.material.validate().map_err(|r| format!("material.{r}"))?;
        self.pins.validate().map_err(|r| format!("pins.{r}"))
    }
}
