//! Makes the masks of a recording in the folder structure that the reconstruction reads.

use crate::{Error, Result, check_interrupted, counted};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_camera::{ColorImage, Mask};
use trocar_core::Progress;
use trocar_recording::{InstrumentRule, Recording, RgbdFrame};
use trocar_report::overlays::overlay;
use trocar_segment::{MetalDetector, Picture, Sam2, Segmenter, Target, Tracker, WantedFile, wanted_files};
use trocar_specimen::StagedFolder;

/// The file whose presence makes a folder one of masks.
const MARKER: &str = "masks.json";

/// Settings of the segmentation of a recording.
#[derive(Clone, Debug, Default)]
pub struct Segment {
    /// Folder with the networks of SAM 2.1, for organs with points and to follow the recording's
    /// instruments.
    pub sam: Option<PathBuf>,
    /// ONNX Runtime's library; `ORT_DYLIB_PATH` by default.
    pub onnxruntime: Option<PathBuf>,
}

/// The result of a segmentation.
#[derive(Clone, Debug, Serialize)]
pub struct Segmented {
    /// The folder of masks.
    pub masks: String,
    /// Organs, and the number of pixels of each.
    pub organs: Vec<(String, usize)>,
    /// How the instruments were found.
    pub instruments: String,
    /// Number of frames with instrument masks.
    pub frames: usize,
    /// Mean share of a frame that instruments cover.
    pub covered: f64,
    /// Wall time (s).
    pub seconds: f64,
}

/// A file that SAM 2.1 needs, for printing.
#[derive(Clone, Debug, Serialize)]
pub struct WeightFile {
    /// Its name, or how it is recognised.
    pub name: &'static str,
    /// Its purpose.
    pub purpose: &'static str,
    /// Where it was found, if it was.
    pub found: Option<String>,
    /// How to get it.
    pub how_to_get: &'static str,
}

/// The files that SAM 2.1 needs, and which of them are present.
pub fn weight_files(folder: Option<&Path>) -> Vec<WeightFile> {
    let of = |w: WantedFile| WeightFile {
        name: w.name,
        purpose: w.purpose,
        found: w.found.map(|p| p.display().to_string()),
        how_to_get: w.how_to_get,
    };
    wanted_files(folder).into_iter().map(of).collect()
}

impl Segment {
    /// Writes masks of every organ with points, and of the instruments of every frame, into the
    /// folder `output`, with pictures for checking. SAM 2.1 follows instruments that the recording
    /// marks; without any, metal is detected. A recording with `instruments = "none"` gets no
    /// instrument masks.
    ///
    /// # Errors
    /// One line that names the file, organ or instrument; `output` then stays unchanged.
    pub fn run(&self, recording: &Path, output: &Path, progress: &dyn Progress) -> Result<Segmented> {
        let clock = Instant::now();
        let recording = Recording::open(recording)?;
        if output.exists() {
            let reason = "the folder exists and is not overwritten, because its masks may have been corrected by hand; choose a new folder";
            return Err(Error::Exists { path: output.to_owned(), reason: reason.into() });
        }
        let staged = StagedFolder::create(output, MARKER)?;
        let folder = staged.path();
        let organs: Vec<_> = recording.info.organs.iter().filter(|o| !o.points.is_empty()).collect();
        // `instruments = "none"` goes before instruments that are marked.
        let without = recording.info.instruments == InstrumentRule::None;
        let follow = !recording.info.followed.is_empty() && !without;
        if without && organs.is_empty() {
            let reason = "there is nothing to segment: instruments = \"none\", and no organ has points";
            return Err(Error::Mismatch(format!("{}: {reason}", recording.toml().display())));
        }
        let sam = match (&self.sam, organs.is_empty() && !follow) {
            (Some(weights), false) => Some(Sam2::open(weights, self.onnxruntime.as_deref())?),
            (None, false) => {
                let reason =
                    "points and [[instrument]] need SAM 2.1: --sam FOLDER; `trocar segment --weights` lists the files";
                return Err(Error::Mismatch(format!("{}: {reason}", recording.toml().display())));
            }
            (_, true) => None,
        };
        if !without {
            make(&folder.join("instruments"))?;
        }
        let middle = recording.frame(recording.len() / 2)?;
        let mut found = Vec::new();
        let mut shown = middle.color.clone();
        for (index, organ) in organs.iter().enumerate() {
            let Some(sam) = &sam else { break };
            let target = Target {
                name: organ.name.clone(),
                points: organ.points.clone(),
                points_outside: organ.points_outside.clone(),
                ..Target::default()
            };
            let picture = Picture { color: &middle.color, depth: None, name: "the middle frame" };
            let mask = sam.segment(&picture, &target)?;
            mask.write_png(&folder.join(format!("{}.png", organ.name)))?;
            overlay(&mut shown, &mask, index);
            found.push((organ.name.clone(), mask.count()));
        }
        shown.write_png(&folder.join("organs-seen.png"))?;
        progress.begin("frames", if without { 0 } else { recording.len() as u64 });
        let covered = match (&sam, follow) {
            _ if without => Ok(Vec::new()),
            (Some(sam), true) => followed(&recording, sam, folder, progress),
            _ => by_metal(&recording, folder, progress),
        }?;
        progress.end();
        let segmented = Segmented {
            masks: output.display().to_string(),
            organs: found,
            instruments: match (&sam, follow) {
                _ if without => "none, as the recording says".to_owned(),
                (Some(sam), true) => format!("followed by {}", sam.describe()),
                _ => MetalDetector::default().describe(),
            },
            frames: if without { 0 } else { recording.len() },
            covered: covered.iter().sum::<f64>() / covered.len().max(1) as f64,
            seconds: clock.elapsed().as_secs_f64(),
        };
        let json = serde_json::to_vec_pretty(&segmented).map_err(|e| Error::Format(e.to_string()))?;
        let path = folder.join(MARKER);
        std::fs::write(&path, json).map_err(|source| Error::Io { path, source })?;
        staged.commit()?;
        Ok(segmented)
    }
}

/// Detects metal in every frame, many frames in parallel.
fn by_metal(recording: &Recording, folder: &Path, progress: &dyn Progress) -> Result<Vec<f64>> {
    let all: Vec<usize> = (0..recording.len()).collect();
    let detector = MetalDetector::default();
    let target = Target { name: "instruments".into(), ..Target::default() };
    let shares: Result<Vec<f64>> = recording
        .packets(&all)
        .par_bridge()
        .map(|packet| {
            check_interrupted(progress)?;
            // A broken frame has no mask; the composite leaves it out too.
            let Ok(frame) = packet.parts.and_then(|parts| recording.decode(packet.frame, &parts)) else {
                return Ok(0.0);
            };
            let name = recording.frame_name(packet.frame);
            let picture = Picture { color: &frame.color, depth: Some(&frame.depth), name: &name };
            let mask = detector.segment(&picture, &target)?;
            save(folder, recording, packet.frame, &frame, &mask)?;
            progress.advance(1);
            Ok(share(&mask))
        })
        .collect();
    shares
}

/// Follows every instrument of the recording forward and backward from its marked frame.
fn followed(recording: &Recording, sam: &Sam2, folder: &Path, progress: &dyn Progress) -> Result<Vec<f64>> {
    let mut masks: Vec<Option<Mask>> = vec![None; recording.len()];
    let frame_of = |index: usize| -> Result<Option<RgbdFrame>> {
        check_interrupted(progress)?;
        Ok(recording.frame(index).ok())
    };
    for instrument in &recording.info.followed {
        let first = instrument.frame;
        let target = Target {
            name: instrument.name.clone(),
            points: instrument.points.clone(),
            points_outside: instrument.points_outside.clone(),
            ..Target::default()
        };
        if first >= recording.len() {
            let reason = format!("frame is {first}; the recording has {}", counted(recording.len(), "frame"));
            return Err(Error::Mismatch(format!("instrument '{}': {reason}", instrument.name)));
        }
        let ways: [Vec<usize>; 2] = [(first..recording.len()).collect(), (0..=first).rev().collect()];
        for way in ways {
            let mut tracker = Tracker::new(sam);
            for (step, index) in way.into_iter().enumerate() {
                let Some(frame) = frame_of(index)? else { continue };
                let name = recording.frame_name(index);
                let picture = Picture { color: &frame.color, depth: None, name: &name };
                let mask = if step == 0 { tracker.start(&picture, &target)? } else { tracker.next(&picture)? };
                let all = masks[index].get_or_insert_with(|| Mask::new(mask.width, mask.height));
                all.set.iter_mut().zip(&mask.set).for_each(|(a, b)| *a |= *b);
                progress.advance(u64::from(step > 0 && instrument == &recording.info.followed[0]));
            }
        }
    }
    let mut shares = Vec::new();
    for (index, mask) in masks.iter().enumerate() {
        if let (Some(mask), Some(frame)) = (mask, frame_of(index)?) {
            save(folder, recording, index, &frame, mask)?;
            shares.push(share(mask));
        }
    }
    Ok(shares)
}

/// Writes the mask of a frame, and for a few frames over the recording a picture for checking.
fn save(folder: &Path, recording: &Recording, index: usize, frame: &RgbdFrame, mask: &Mask) -> Result<()> {
    const SHOWN: usize = 6;
    mask.write_png(&folder.join("instruments").join(recording.mask_file_name(index)))?;
    if index.is_multiple_of(recording.len().div_ceil(SHOWN).max(1)) {
        let mut shown: ColorImage = frame.color.clone();
        overlay(&mut shown, mask, 0);
        shown.write_png(&folder.join(format!("instruments-seen-{index:06}.png")))?;
    }
    Ok(())
}

fn share(mask: &Mask) -> f64 {
    mask.count() as f64 / mask.set.len().max(1) as f64
}

fn make(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|source| Error::Io { path: path.to_owned(), source })
}
