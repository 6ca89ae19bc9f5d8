//! Table IV's silhouettes and pictures (paper section VII-E): reconstructions rendered through the recovered recording camera beside the
//! recordings, and through the endoscope beside an oblique view.

mod fill;
mod in_vivo;
mod measure;
mod oblique;
mod real;
mod scenery;

pub(crate) use measure::SimilarityPictures;
pub use measure::SimilarityRow;

use crate::{Error, Result, pages};
use measure::{Sides, labelled, measure};
use scenery::{Illumination, Scenery};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::{Reconstruction, Settings};
use trocar_recording::Recording;
use trocar_workflow::phantoms::recorded;
use trocar_workflow::{REPORT, reconstruct_recording};

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "similarity.json";

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct SimilarityExperiment {
    /// Which phantoms.
    pub phantoms: Vec<String>,
    /// How they are filmed. An earlier recording in the output folder is used again when it is of the same options.
    pub record: RecordOptions,
    /// Folder with the real recordings.
    pub data: PathBuf,
    /// Paths a pixel.
    pub samples: u32,
}

/// The paper's figures (its table of real-to-sim similarity).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PaperSimilarity {
    /// Mean silhouette IoU.
    pub iou: f64,
    /// SSIM and PSNR [dB] of its path-traced view.
    pub rendered: [f64; 2],
    /// The same after matching the exposure.
    pub matched: [f64; 2],
    /// The same of a second real frame.
    pub second_frame: [f64; 2],
    /// The same of the mean colour.
    pub mean_colour: [f64; 2],
}

/// What the paper measured on its rabbit.
const PAPER: PaperSimilarity = PaperSimilarity {
    iou: 0.80,
    rendered: [0.43, 14.7],
    matched: [0.63, 20.4],
    second_frame: [0.67, 19.5],
    mean_colour: [0.66, 19.0],
};

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct SimilarityResult {
    /// Every specimen through its recording camera.
    pub rows: Vec<SimilarityRow>,
    /// Oblique views through the endoscope.
    pub in_vivo: Vec<SimilarityRow>,
    /// What was left out, and why.
    pub skipped: Vec<String>,
    /// The paper's figures.
    pub paper: PaperSimilarity,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl SimilarityExperiment {
    /// Runs everything into the folder `output`: `<specimen>/recording`, `<specimen>/specimen`, pictures, and the report.
    ///
    /// # Errors
    /// A phantom of another name, a folder that cannot be written, an interruption; what is finished by then is used again.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<SimilarityResult> {
        let clock = Instant::now();
        super::claim(output, MARKER)?;
        let (mut rows, mut in_vivo, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
        for phantom in &self.phantoms {
            let folder = output.join(phantom);
            let recording = folder.join("recording");
            recorded(phantom, &self.record, &recording, progress)?;
            let made = reconstruct_recording(&recording, &Settings::default(), &folder.join("specimen"), progress)?.1;
            let lamp = Illumination::Lamp { beside: 0.0 };
            rows.push(self.beside_recording(
                phantom,
                &folder,
                &made,
                lamp,
                "masks: the truth; light: a lamp at the lens",
                progress,
            )?);
        }
        if let Some(phantom) = self.phantoms.first() {
            in_vivo.push(self.oblique(phantom, output, progress)?);
        }
        let mug = output.join(real::MUG);
        if real::prepare_mug(&self.data, &mug.join("recording"))? {
            let recording = mug.join("recording");
            let made = reconstruct_recording(&recording, &Settings::default(), &mug.join("specimen"), progress)?.1;
            let note = "masks: an outline by hand; light: even, as in the room";
            rows.push(self.beside_recording(real::MUG, &mug, &made, Illumination::Room, note, progress)?);
            in_vivo.push(self.through_endoscope(real::MUG, &mug, &made, Illumination::Room, note, progress)?);
        } else {
            skipped.push(format!(
                "{}: {} has no {}/color.png and depth.png",
                real::MUG,
                self.data.display(),
                real::MUG
            ));
        }
        let (rows, shown): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let (in_vivo, oblique): (Vec<_>, Vec<_>) = in_vivo.into_iter().unzip();
        let result = SimilarityResult {
            rows,
            in_vivo,
            skipped,
            paper: PAPER,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        let html = pages::similarity(&result, &shown, &oblique)?;
        super::write(&output.join(REPORT), html.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    /// A reconstruction through its recording camera beside the recording's first frame.
    fn beside_recording(
        &self,
        name: &str,
        folder: &Path,
        made: &Reconstruction,
        light: Illumination,
        note: &str,
        progress: &dyn Progress,
    ) -> Result<(SimilarityRow, SimilarityPictures)> {
        stop_if_asked(progress)?;
        let recording = Recording::open(&folder.join("recording"))?;
        let (first, second) = (recording.frame(0)?, (recording.len() > 1).then(|| recording.frame(1)).transpose()?);
        let scenery = Scenery::new(made, light)?;
        let camera = scenery.camera;
        let labels = scenery.labels(&camera)?;
        let rendered = scenery.picture(&camera, self.samples)?;
        let organs = made
            .organs
            .iter()
            .enumerate()
            .map(|(k, o)| (o.name.clone(), o.mask.clone(), labelled(&labels, k, camera.width, camera.height)));
        let (row, pictures) = measure(&Sides {
            specimen: name.to_owned(),
            note: note.to_owned(),
            organs: organs.collect(),
            real: &first.color,
            rendered: &rendered,
            covered: &first.instruments,
            second: second.as_ref().map(|s| (&s.color, &s.instruments)),
            composite: Some(&made.background),
        })?;
        rendered.write_png(&folder.join("rendered.png"))?;
        first.color.write_png(&folder.join("real.png"))?;
        Ok((row, pictures))
    }
}

fn stop_if_asked(progress: &dyn Progress) -> Result<()> {
    if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
}
