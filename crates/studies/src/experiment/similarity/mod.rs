//! Silhouettes and pictures of Table IV (paper section VII-E): reconstructions rendered through the
//! recovered recording camera against the recordings, and through the endoscope against an oblique
//! view; filmed lifts beside simulated ones.

mod deforming;
mod endoscope;
mod fill;
mod measure;
mod oblique;
mod page;
mod real;
mod result;
mod scenery;
mod through_endoscope;

pub use measure::SimilarityRow;
pub use result::SimilarityResult;

use crate::names::{Recorded, phantoms_or_papers};
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use measure::{Sides, SimilarityPictures, first_frames, labelled, measure};
use result::PAPER;
use scenery::{Illumination, Scenery};
use std::path::{Path, PathBuf};
use through_endoscope::{from_the_side, through_endoscope};
use trocar_core::Progress;
use trocar_reconstruct::{Reconstruction, Settings};
use trocar_report::document::Document;
use trocar_workflow::phantoms::recorded;
use trocar_workflow::{check_interrupted, reconstruct_recording};

/// Silhouettes, SSIM and PSNR of rendered reconstructions against the recordings, oblique views
/// through the endoscope, and simulated lifts beside filmed ones.
#[derive(Clone, Debug, Args)]
pub struct SimilarityExperiment {
    /// Phantoms; phantom-a, phantom-b and phantom-c by default. The first is also recorded from the
    /// side.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// How they are recorded.
    #[command(flatten)]
    pub recorded: Recorded,
    /// Folder of real recordings; missing ones are skipped.
    #[arg(long, value_name = "FOLDER", default_value = "../shared/data")]
    pub data: PathBuf,
    /// Filmed lifts of phantom-a that are simulated and compared, at rest and under load; 0 for
    /// none, else 2 or more.
    #[arg(long, default_value_t = 4)]
    pub lifts: usize,
    /// Paths per pixel.
    #[arg(long, default_value_t = 16)]
    pub samples: u32,
}

impl Study for SimilarityExperiment {
    const NAME: &'static str = "similarity";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of recordings, specimens, pictures and report. Finished recordings in it are used again.");
    type Figures = SimilarityResult;

    fn run(&self, job: &Job<'_>) -> Result<(SimilarityResult, Document)> {
        if self.lifts == 1 {
            let reason = "--lifts is 1; must be 0, or 2 or more: tissue is identified from the other half";
            return Err(Error::Mismatch(reason.to_owned()));
        }
        job.claim()?;
        let (output, progress) = (job.output(), job.progress);
        let phantoms = phantoms_or_papers(&self.phantoms);
        let (mut rows, mut oblique, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
        for phantom in &phantoms {
            let folder = output.join(phantom);
            let recording = folder.join("recording");
            recorded(phantom, &self.recorded.options(), &recording, progress)?;
            let made = reconstruct_recording(&recording, &Settings::default(), &folder.join("specimen"), progress)?
                .reconstruction;
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
        if let Some(phantom) = phantoms.first() {
            oblique.push(from_the_side(self.samples, phantom, output, progress)?);
        }
        let mug = output.join(real::MUG);
        if real::prepare_mug(&self.data, &mug.join("recording"))? {
            let recording = mug.join("recording");
            let made = reconstruct_recording(&recording, &Settings::default(), &mug.join("specimen"), progress)?
                .reconstruction;
            let note = "masks: an outline by hand; light: even, as in the room";
            rows.push(self.beside_recording(real::MUG, &mug, &made, Illumination::Room, note, progress)?);
            oblique.push(through_endoscope(self.samples, real::MUG, &mug, &made, Illumination::Room, note, progress)?);
        } else {
            skipped.push(format!(
                "{}: {} has no {}/color.png and depth.png",
                real::MUG,
                self.data.display(),
                real::MUG
            ));
        }
        let lifts = match self.lifts {
            0 => Vec::new(),
            lifts => deforming::deforming((lifts, self.recorded.seed, self.samples), output, progress)?,
        };
        let (deforming, lifted): (Vec<_>, Vec<_>) = lifts.into_iter().unzip();
        let (rows, shown): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let (oblique, seen_obliquely): (Vec<_>, Vec<_>) = oblique.into_iter().unzip();
        let result = SimilarityResult { rows, oblique, deforming, skipped, paper: PAPER };
        let document = page::document(&result, &shown, &seen_obliquely, &lifted)?;
        Ok((result, document))
    }
}

impl SimilarityExperiment {
    /// Compares a reconstruction, rendered through its recording camera, with the first frame of
    /// the recording.
    fn beside_recording(
        &self,
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
            composite: Some(&made.composite.color),
        })?;
        rendered.write_png(&folder.join("rendered.png"))?;
        first.color.write_png(&folder.join("real.png"))?;
        Ok((row, pictures))
    }
}
