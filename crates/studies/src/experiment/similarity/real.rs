//! Real recordings beside the repository, made into folders that the reconstruction reads.

use crate::{Error, Result};
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage};
use trocar_recording::{RecordingInfo, RecordingWriter};

/// The mug of pyk4a's tests: a colour and a depth frame of an Azure Kinect, seen from the side.
pub(super) const MUG: &str = "k4a_mug";

/// What is known of it.
const DESCRIPTION: &str = include_str!("../../../../../examples/recordings/k4a_mug_color.toml");

/// Makes the mug's recording of the frames in `data`; false where they are not there.
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
