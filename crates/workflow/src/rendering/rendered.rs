//! What `trocar render` tells of a picture.

use super::colors::label_color;
use serde::Serialize;
use trocar_sensors::CameraRig;

/// A picture that was made.
#[derive(Clone, Debug, Serialize)]
pub struct Rendered {
    /// The camera.
    pub camera: String,
    /// Width of the picture [px].
    pub width: usize,
    /// Height of the picture [px].
    pub height: usize,
    /// Simulated time of the picture, of a moving one of its last frame [s].
    pub time_s: f64,
    /// Frames.
    pub frames: usize,
    /// Paths a pixel; 0 for direct light alone.
    pub samples: u32,
    /// Triangles on the stage.
    pub triangles: usize,
    /// Wall time of the pictures [s].
    pub render_s: f64,
    /// What was seen: name and label, colour in the picture of labels, share of the picture.
    pub seen: Vec<Seen>,
    /// Files.
    pub files: Vec<String>,
    /// Where the episode that was done again is not the recorded one, as one of another version of the program may be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub differs: Option<String>,
}

/// Something in a picture.
#[derive(Clone, Debug, Serialize)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// Its label.
    pub label: u16,
    /// Its sRGB colour in the picture of labels.
    pub color: [u8; 3],
    /// Share of the pixels.
    pub share: f64,
}

/// What is in a picture of `labels`, with its shares.
pub(super) fn seen(sight: &CameraRig, labels: &[u16]) -> Vec<Seen> {
    let count = |label: u16| labels.iter().filter(|l| **l == label).count() as f64 / labels.len().max(1) as f64;
    let row = |(label, name): &(u16, String)| Seen {
        name: name.clone(),
        label: *label,
        color: label_color(*label),
        share: count(*label),
    };
    sight.labels().iter().map(row).filter(|s| s.share > 0.0).collect()
}
