//! The figures that `trocar render` prints.

use serde::Serialize;
use trocar_report::picture_colors::label_color;
use trocar_sensors::CameraRig;

/// The figures of a picture or video.
#[derive(Clone, Debug, Serialize)]
pub struct Rendered {
    /// The camera.
    pub camera: String,
    /// Width (px).
    pub width: usize,
    /// Height (px).
    pub height: usize,
    /// Simulated time of the picture, or of the last frame of a video (s).
    pub time_s: f64,
    /// Number of frames.
    pub frames: usize,
    /// Paths per pixel; 0 for direct light only.
    pub samples: u32,
    /// Whether their noise was filtered out.
    pub denoised: bool,
    /// Number of triangles of the scene.
    pub triangles: usize,
    /// Wall time of rendering (s).
    pub render_s: f64,
    /// The visible objects.
    pub seen: Vec<VisibleObject>,
    /// The written files.
    pub files: Vec<String>,
    /// The first difference of the replay from the recorded episode, as after a change of the
    /// program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differs: Option<String>,
}

/// An object in a picture.
#[derive(Clone, Debug, Serialize)]
pub struct VisibleObject {
    /// Its name.
    pub name: String,
    /// Its label.
    pub label: u16,
    /// Its sRGB colour in the picture of labels.
    pub color: [u8; 3],
    /// Its share of the pixels.
    pub share: f64,
}

/// The objects in a picture of `labels`.
pub(super) fn visible_objects(rig: &CameraRig, labels: &[u16]) -> Vec<VisibleObject> {
    let count = |label: u16| labels.iter().filter(|l| **l == label).count() as f64 / labels.len().max(1) as f64;
    let row = |(label, name): &(u16, String)| VisibleObject {
        name: name.clone(),
        label: *label,
        color: label_color(*label),
        share: count(*label),
    };
    rig.labels().iter().map(row).filter(|s| s.share > 0.0).collect()
}
