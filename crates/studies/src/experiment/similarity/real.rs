//! Real recordings beside the repository, converted into recording folders.

use crate::{Error, Result};
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage};
use trocar_recording::{RecordingInfo, RecordingWriter};

/// The mug from the tests of pyk4a: a colour and a depth frame of an Azure Kinect, from the side.
pub(super) const MUG: &str = "k4a_mug";

const DESCRIPTION: &str = include_str!("k4a_mug_color.toml");

/// Writes the recording of the mug from the frames in `data`; returns false if they are missing.
pub(super) fn prepare_mug(data: &Path, recording: &Path) -> Result<bool> {
    let [color, depth] = ["color.png", "depth.png"].map(|name| data.join(MUG).join(name));
    if !color.is_file() || !depth.is_file() {
        return Ok(false);
    }
    let info: RecordingInfo = toml::from_str(DESCRIPTION).map_err(|e| Error::Format(e.to_string()))?;
    let scale = info.depth_scale_m.unwrap_or(0.001);
    let (color, depth) = (ColorImage::read(&color)?, DepthImage::read(&depth, scale)?);
    let writer = RecordingWriter::create(recording, &info)?;
    writer.frame(0, &color, &depth, None)?;
    writer.finish()?;
    Ok(true)
}
