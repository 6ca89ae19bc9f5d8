//! `recording.toml`.

use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;
use trocar_camera::Camera;
use trocar_specimen::{Material, Pins};

/// What is known of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingInfo {
    /// Name of the recording.
    pub name: String,
    /// Frames per second.
    pub rate_hz: f64,
    /// Metres per unit of the depth images.
    pub depth_scale_m: f64,
    /// Unit vector against gravity in the camera frame; a camera that looks straight down has [0, 0, -1].
    pub up: [f64; 3],
    /// Added to a depth pixel (u, v) to reach the colour pixel it belongs to, for depth that is not registered [px].
    #[serde(default)]
    pub depth_offset_px: [f64; 2],
    /// Depth beyond this is treated as invalid [m]; no limit by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_max_m: Option<f64>,
    /// Where the numbers come from, and what of them is an estimate.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// The camera (of the depth images, to which colour is registered).
    pub camera: Camera,
    /// The organs to reconstruct.
    #[serde(default, rename = "organ")]
    pub organs: Vec<OrganInfo>,
}

/// One organ of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrganInfo {
    /// Name; its mask is `masks/<name>.png` unless `polygon` is given.
    pub name: String,
    /// Outline in colour-image pixels [u, v], instead of a mask file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub polygon: Vec<[f64; 2]>,
    /// Pixel near the organ's base (organ coordinate 0); by default the end nearer the image's centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base_px: Option<[f64; 2]>,
    /// Material; the default material when absent.
    #[serde(default)]
    pub material: Material,
    /// Pins; the lowest 42% of the nodes when absent.
    #[serde(default = "default_pins")]
    pub pins: Pins,
}

/// The paper's share of pinned nodes (section IV-B, about 42%).
fn default_pins() -> Pins {
    Pins::Band { share: 0.42 }
}

impl RecordingInfo {
    /// Checks every field and normalises `up`. `path` is the file the errors name.
    ///
    /// # Errors
    /// Names the field, its value and what would be right.
    pub fn validate(&mut self, path: &Path) -> Result<()> {
        let wrong = |reason: String| Err(Error::Recording { path: path.to_owned(), reason });
        if let Err(e) = self.camera.validate() {
            return wrong(e.to_string());
        }
        if !(self.rate_hz > 0.0 && self.rate_hz <= 10_000.0) {
            return wrong(format!("rate_hz is {}; frames per second, above 0", self.rate_hz));
        }
        if !(1e-6..=0.1).contains(&self.depth_scale_m) {
            return wrong(format!(
                "depth_scale_m is {}; metres per unit of the depth images, 0.001 for millimetres (1e-6 to 0.1)",
                self.depth_scale_m
            ));
        }
        let up = DVec3::from(self.up);
        match up.try_normalize() {
            // A unit vector stays as it is, to the last bit.
            Some(unit) if (up.length() - 1.0).abs() > 1e-9 => self.up = unit.into(),
            Some(_) => {}
            None => {
                return wrong(format!(
                    "up is {:?}; a direction, such as [0, 0, -1] for a camera that looks down",
                    self.up
                ));
            }
        }
        if self.depth_offset_px.iter().any(|o| !(-10_000.0..=10_000.0).contains(o)) {
            return wrong(format!("depth_offset_px is {:?}; two numbers of pixels", self.depth_offset_px));
        }
        if let Some(max) = self.depth_max_m
            && (max.is_nan() || max <= 0.0)
        {
            return wrong(format!("depth_max_m is {max}; metres, above 0"));
        }
        for (i, organ) in self.organs.iter().enumerate() {
            if let Err(reason) = trocar_specimen::check_name(&organ.name) {
                return wrong(format!("organ[{i}].name: {reason}"));
            }
            if organ.name == "instruments" {
                return wrong(format!(
                    "organ[{i}].name is 'instruments', which names the instrument masks; choose another"
                ));
            }
            if self.organs[..i].iter().any(|o| o.name == organ.name) {
                return wrong(format!("organ[{i}].name is '{}' a second time; names are unique", organ.name));
            }
            organ.validate(self.camera).or_else(|reason| wrong(format!("organ '{}': {reason}", organ.name)))?;
        }
        Ok(())
    }
}

impl OrganInfo {
    fn validate(&self, camera: Camera) -> std::result::Result<(), String> {
        let n = self.polygon.len();
        if n == 1 || n == 2 {
            return Err(format!("polygon has {n} points; an outline has at least 3"));
        }
        if self.polygon.iter().flatten().any(|c| !c.is_finite()) {
            return Err("polygon has a coordinate that is not a finite number".into());
        }
        if let Some([u, v]) = self.base_px {
            let (w, h) = (camera.width as f64, camera.height as f64);
            if !((0.0..w).contains(&u) && (0.0..h).contains(&v)) {
                return Err(format!("base_px is [{u}, {v}]; a pixel of the {w} x {h} image"));
            }
        }
        self.material.validate().map_err(|r| format!("material.{r}"))?;
        self.pins.validate().map_err(|r| format!("pins.{r}"))
    }
}
