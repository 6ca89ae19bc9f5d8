//! `recording.toml`.

use serde::{Deserialize, Serialize};
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
