//! Finds organs and instruments: each by the segmenter that its description needs.

use crate::{Error, Result, Settings};
use std::path::Path;
use trocar_camera::{ColorImage, Mask};
use trocar_recording::{InstrumentRule, OrganInfo, Recording, RgbdFrame};
use trocar_segment::{MaskFolder, MetalDetector, Picture, Polygon, Sam2, Segmenter, Target};

/// Finds the organs of a recording in its composite.
pub struct OrganSegmenters {
    files: MaskFolder,
    polygon: Polygon,
    /// Opened where an organ has only points.
    sam: Option<Sam2>,
}

fn target(organ: &OrganInfo) -> Target {
    Target {
        name: organ.name.clone(),
        polygon: organ.polygon.clone(),
        points: organ.points.clone(),
        points_outside: organ.points_outside.clone(),
        box_px: None,
    }
}

/// Whether the organ has points, but neither an outline nor a mask file.
fn only_points(organ: &OrganInfo, masks: &Path) -> bool {
    !organ.points.is_empty() && organ.polygon.is_empty() && !masks.join(format!("{}.png", organ.name)).is_file()
}

impl OrganSegmenters {
    /// Opens the segmenters of the organs of `recording` and checks that each organ can be found,
    /// so that a missing mask is not noticed after minutes of work.
    pub fn open(recording: &Recording, settings: &Settings) -> Result<Self> {
        let folder = recording.dir().join("masks");
        let organs = &recording.info.organs;
        let pointed_at = organs.iter().find(|o| only_points(o, &folder));
        let sam = match (pointed_at, &settings.sam) {
            (None, _) => None,
            (Some(_), Some(weights)) => Some(Sam2::open(weights, settings.onnxruntime.as_deref())?),
            (Some(organ), None) => {
                let reason = "it has only points, which need SAM 2.1 (--sam FOLDER; `trocar segment --weights` \
                              lists the files); otherwise draw a polygon or a mask";
                return Err(Error::Organ { organ: organ.name.clone(), reason: reason.into() });
            }
        };
        let segmenters = Self { files: MaskFolder { folder }, polygon: Polygon, sam };
        let camera = recording.camera();
        let blank = ColorImage::new(camera.width, camera.height, [0; 3]);
        for organ in organs.iter().filter(|o| !only_points(o, &segmenters.files.folder)) {
            segmenters.mask(organ, &blank)?;
        }
        Ok(segmenters)
    }

    pub fn mask(&self, organ: &OrganInfo, color: &ColorImage) -> Result<Mask> {
        let wrong = |reason: String| Error::Organ { organ: organ.name.clone(), reason };
        let file = self.files.folder.join(format!("{}.png", organ.name));
        let segmenter: &dyn Segmenter = match &self.sam {
            _ if !organ.polygon.is_empty() => &self.polygon,
            Some(sam) if only_points(organ, &self.files.folder) => sam,
            _ if !file.is_file() => {
                let reason = format!(
                    "it has no mask: {} does not exist, and there are neither a polygon nor points",
                    file.display()
                );
                return Err(wrong(reason));
            }
            _ => &self.files,
        };
        let picture = Picture { color, depth: None, name: "the composite" };
        let mask = segmenter.segment(&picture, &target(organ)).map_err(|e| wrong(e.to_string()))?;
        if mask.count() == 0 {
            return Err(wrong(format!(
                "its mask is empty ({}); it covers no pixel of the image",
                segmenter.describe()
            )));
        }
        Ok(mask)
    }
}

/// The mask of an organ that is drawn: its outline, or its file in the folder `masks`. `None` if it
/// has only points for SAM 2.1.
///
/// # Errors
/// Names the organ whose mask is missing, broken, of the wrong size or empty.
pub fn drawn_mask(recording: &Recording, organ: &OrganInfo) -> Result<Option<Mask>> {
    let folder = recording.dir().join("masks");
    if only_points(organ, &folder) {
        return Ok(None);
    }
    let camera = recording.camera();
    let blank = ColorImage::new(camera.width, camera.height, [0; 3]);
    OrganSegmenters { files: MaskFolder { folder }, polygon: Polygon, sam: None }.mask(organ, &blank).map(Some)
}

/// Pixels of a frame that instruments cover, by the recording's rule; `None` for the recording's
/// own masks.
pub fn instruments(rule: InstrumentRule, frame: &RgbdFrame, name: &str) -> Result<Option<Mask>> {
    match rule {
        InstrumentRule::Masks => Ok(None),
        InstrumentRule::None => Ok(Some(Mask::new(frame.color.width, frame.color.height))),
        InstrumentRule::Metal => {
            let picture = Picture { color: &frame.color, depth: Some(&frame.depth), name };
            let target = Target { name: "instruments".into(), ..Target::default() };
            Ok(Some(MetalDetector::default().segment(&picture, &target)?))
        }
    }
}
