//! An oblique view through the endoscope's model beside the real frame (paper section VIII, in-vivo
//! extension).

use super::endoscope::endoscope_camera;
use super::measure::{Sides, SimilarityPictures, SimilarityRow, first_frames, labelled, measure};
use super::oblique;
use super::scenery::{BESIDE_LENS, Illumination, Scenery};
use crate::Result;
use std::path::Path;
use trocar_camera::{CameraModel, ColorImage, Mask, UndistortionMap};
use trocar_core::{Pose, Progress};
use trocar_reconstruct::{Reconstruction, Settings};
use trocar_workflow::{check_interrupted, reconstruct_recording};

/// Distance at which the endoscope's light renders a white surface white (m), for scenes recorded
/// in other light.
const WHITE_AT: f64 = 0.35;

/// A phantom recorded through the endoscope from the side, reconstructed, and rendered through the
/// endoscope.
pub(super) fn from_the_side(
    samples: u32,
    phantom: &str,
    output: &Path,
    progress: &dyn Progress,
) -> Result<(SimilarityRow, SimilarityPictures)> {
    let name = format!("{phantom}-oblique");
    let folder = output.join(&name);
    std::fs::create_dir_all(&folder).map_err(|source| crate::Error::Io { path: folder.clone(), source })?;
    let recording = folder.join("recording");
    oblique::record(&output.join(phantom).join("recording"), &recording, samples, progress)?;
    let made =
        reconstruct_recording(&recording, &Settings::default(), &folder.join("specimen"), progress)?.reconstruction;
    let light = Illumination::Lamp { beside: BESIDE_LENS };
    let note = "masks: the truth; light: the endoscope's";
    through_endoscope(samples, &name, &folder, &made, light, note, progress)
}

/// Compares a reconstruction, rendered through the thirty-degree endoscope at the pose of the
/// recording camera, with the first frame of the recording seen through the endoscope's lens.
pub(super) fn through_endoscope(
    samples: u32,
    name: &str,
    folder: &Path,
    made: &Reconstruction,
    light: Illumination,
    note: &str,
    progress: &dyn Progress,
) -> Result<(SimilarityRow, SimilarityPictures)> {
    check_interrupted(progress)?;
    let (first, second) = first_frames(folder)?;
    let scenery = Scenery::new(made, light)?;
    let scope = endoscope_camera(scenery.camera.width);
    let map = CameraModel::from(scenery.camera).undistortion_map(&scope);
    let seen = |image: &ColorImage| map.apply(image);
    let real = seen(&first.color);
    let labels = scenery.labels(&scope)?;
    let organs = made
        .organs
        .iter()
        .enumerate()
        .map(|(k, o)| (o.name.clone(), masked(&map, &o.mask), labelled(&labels, k, scope.width, scope.height)));
    let rendered = scenery.picture(&scope, samples)?;
    let second = second.map(|s| (seen(&s.color), masked(&map, &s.instruments)));
    let (row, mut pictures) = measure(&Sides {
        specimen: name.to_owned(),
        note: note.to_owned(),
        organs: organs.collect(),
        real: &real,
        rendered: &rendered,
        covered: &masked(&map, &first.instruments),
        second: second.as_ref().map(|(color, covered)| (color, covered)),
        composite: Some(&seen(&made.composite.color)),
    })?;
    if light == Illumination::Room {
        let lit = scenery.through_endoscope(&scope, &Pose::IDENTITY, WHITE_AT, samples)?;
        lit.write_png(&folder.join("endoscope-lit.png"))?;
        pictures.other = Some(("The same by the endoscope\u{2019}s own light, wet.", lit));
    }
    rendered.write_png(&folder.join("endoscope-rendered.png"))?;
    real.write_png(&folder.join("endoscope-real.png"))?;
    Ok((row, pictures))
}

/// The mask, remapped to the nearest pixels.
fn masked(map: &UndistortionMap, mask: &Mask) -> Mask {
    let at = |p: &glam::DVec2| {
        let (x, y) = (p.x.round(), p.y.round());
        // NaN is outside.
        let inside = x >= 0.0 && y >= 0.0 && x < mask.width as f64 && y < mask.height as f64;
        inside && mask.set[y as usize * mask.width + x as usize]
    };
    Mask { width: map.width, height: map.height, set: map.from.iter().map(at).collect() }
}
