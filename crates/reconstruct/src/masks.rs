//! Where an organ is seen.

use crate::polygon::fill_polygon;
use crate::{Error, Result};
use trocar_camera::Mask;
use trocar_recording::{OrganInfo, Recording};

/// The still mask of `organ`, from its file or polygon.
///
/// # Errors
/// When the mask is missing, of another size than the images, or empty.
pub fn organ_mask(recording: &Recording, organ: &OrganInfo) -> Result<Mask> {
    let unusable = |reason: String| Error::Organ { organ: organ.name.clone(), reason };
    let camera = recording.camera();
    if !organ.polygon.is_empty() {
        let mask = fill_polygon(camera.width, camera.height, &organ.polygon);
        return match mask.count() {
            0 => Err(unusable("its polygon covers no pixel of the image".into())),
            _ => Ok(mask),
        };
    }
    let path = recording.dir().join("masks").join(format!("{}.png", organ.name));
    if !path.is_file() {
        return Err(unusable(format!(
            "no mask: {} does not exist, and recording.toml gives no polygon",
            path.display()
        )));
    }
    let mask = Mask::read(&path)?;
    if (mask.width, mask.height) != (camera.width, camera.height) {
        return Err(unusable(format!(
            "its mask {} has {} x {} pixels, but the images have {} x {}; masks lie on the image's pixels",
            path.display(),
            mask.width,
            mask.height,
            camera.width,
            camera.height
        )));
    }
    match mask.count() {
        0 => Err(unusable(format!("no pixel of its mask is set: {}", path.display()))),
        _ => Ok(mask),
    }
}
