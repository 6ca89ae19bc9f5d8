//! Comparison of a rendered reconstruction with the real picture.

use crate::Result;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use trocar_camera::metrics::{ImageMetrics, compare, iou, mean_colour, union};
use trocar_camera::{ColorImage, Mask};
use trocar_recording::{Recording, RgbdFrame};

/// Figures of one specimen: silhouettes, and the picture within the organs, against a real frame.
#[derive(Clone, Debug, Serialize)]
pub struct SimilarityRow {
    /// Name.
    pub specimen: String,
    /// Mean intersection over union of the silhouettes of the organs.
    pub iou: f64,
    /// The same of all organs together.
    pub union_iou: f64,
    /// The same of each organ.
    pub organ_iou: BTreeMap<String, f64>,
    /// The rendered picture against the first frame of the recording.
    #[serde(flatten)]
    pub rendered: ImageMetrics,
    /// The second frame of the recording against the first; none with a single frame.
    pub second_frame: Option<ImageMetrics>,
    /// The mean colour of the first frame against that frame.
    pub mean_colour: ImageMetrics,
    /// The rendered picture against the composite, the source of its colours.
    pub composite: Option<ImageMetrics>,
    /// Source of the masks, and light of the rendered picture.
    pub note: String,
}

/// The compared pictures, for the page.
pub(crate) struct SimilarityPictures {
    pub real: ColorImage,
    pub rendered: ColorImage,
    /// Compared pixels.
    pub compared: Mask,
    /// The organs in the real and in the rendered picture.
    pub silhouettes: [Mask; 2],
    /// The rendered picture in another light, with a description.
    pub other: Option<(&'static str, ColorImage)>,
}

/// Inputs of a comparison.
pub(super) struct Sides<'a> {
    pub specimen: String,
    pub note: String,
    /// Names of the organs, true masks, and masks in the rendered picture.
    pub organs: Vec<(String, Mask, Mask)>,
    pub real: &'a ColorImage,
    pub rendered: &'a ColorImage,
    /// Pixels of the real picture covered by instruments.
    pub covered: &'a Mask,
    /// The second frame, and its covered pixels.
    pub second: Option<(&'a ColorImage, &'a Mask)>,
    pub composite: Option<&'a ColorImage>,
}

/// The first frame of the recording in `folder`, and the second if there is one.
pub(super) fn first_frames(folder: &Path) -> Result<(RgbdFrame, Option<RgbdFrame>)> {
    let recording = Recording::open(&folder.join("recording"))?;
    let second = (recording.len() > 1).then(|| recording.frame(1)).transpose()?;
    Ok((recording.frame(0)?, second))
}

/// Returns the figures and the compared pictures.
pub(super) fn measure(sides: &Sides<'_>) -> Result<(SimilarityRow, SimilarityPictures)> {
    let mut organ_iou = BTreeMap::new();
    for (name, real, rendered) in &sides.organs {
        organ_iou.insert(name.clone(), iou(real, rendered)?.unwrap_or(0.0));
    }
    let silhouettes = [union(sides.organs.iter().map(|o| &o.1))?, union(sides.organs.iter().map(|o| &o.2))?];
    let [truth, shown] = &silhouettes;
    let without = |covered: &Mask, of: &Mask| {
        let set = of.set.iter().zip(&covered.set).map(|(of, covered)| *of && !covered).collect();
        Mask { width: of.width, height: of.height, set }
    };
    let compared = without(&grown(sides.covered), truth);
    let second = sides.second.map(|(frame, covered)| compare(sides.real, frame, &without(&grown(covered), &compared)));
    let row = SimilarityRow {
        specimen: sides.specimen.clone(),
        iou: organ_iou.values().sum::<f64>() / organ_iou.len().max(1) as f64,
        union_iou: iou(truth, shown)?.unwrap_or(0.0),
        organ_iou,
        rendered: compare(sides.real, sides.rendered, &compared)?,
        second_frame: second.transpose()?,
        mean_colour: compare(sides.real, &mean_colour(sides.real, &compared)?, &compared)?,
        composite: sides.composite.map(|c| compare(c, sides.rendered, truth)).transpose()?,
        note: sides.note.clone(),
    };
    let pictures = SimilarityPictures {
        real: sides.real.clone(),
        rendered: sides.rendered.clone(),
        compared,
        silhouettes,
        other: None,
    };
    Ok((row, pictures))
}

/// The mask grown by two pixels: the rim of an instrument is blended with its background.
pub(super) fn grown(mask: &Mask) -> Mask {
    let mut out = mask.clone();
    for _ in 0..2 {
        let from = out.set.clone();
        for i in (0..from.len()).filter(|i| from[*i]) {
            trocar_camera::pixel_neighbours(i, mask.width, mask.height).for_each(|j| out.set[j] = true);
        }
    }
    out
}

/// The pixels with the label of organ `index`, which is `index` + 1.
pub(super) fn labelled(labels: &[u16], index: usize, width: usize, height: usize) -> Mask {
    Mask { width, height, set: labels.iter().map(|l| usize::from(*l) == index + 1).collect() }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed test is a failed test")]

    use super::*;

    #[test]
    fn organs_are_compared_separately_without_instruments() {
        let (width, height) = (40, 30);
        let columns = |from: usize, to: usize| Mask {
            width,
            height,
            set: (0..width * height).map(|i| (from..to).contains(&(i % width))).collect(),
        };
        let mut real = ColorImage::new(width, height, [90, 60, 50]);
        let rendered = real.clone();
        // An instrument, and an object beside the organs.
        for (i, p) in real.pixels.iter_mut().enumerate() {
            if (5..8).contains(&(i % width)) || i % width > 30 {
                *p = [255; 3];
            }
        }
        let organs =
            vec![("a".to_owned(), columns(0, 10), columns(0, 10)), ("b".to_owned(), columns(10, 20), columns(15, 20))];
        let covered = columns(5, 8);
        let sides = Sides {
            specimen: "s".into(),
            note: String::new(),
            organs,
            real: &real,
            rendered: &rendered,
            covered: &covered,
            second: None,
            composite: None,
        };
        let (row, pictures) = measure(&sides).unwrap();
        assert_eq!((row.organ_iou["a"], row.organ_iou["b"], row.iou, row.union_iou), (1.0, 0.5, 0.75, 0.75));
        assert_eq!(row.rendered.psnr_db, f64::INFINITY);
        assert_eq!(pictures.compared.count(), 30 * (20 - 7));
    }
}
