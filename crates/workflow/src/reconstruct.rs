//! The commands' work from folder to folder: read, run, write the result and its report.

use crate::{Error, Result, check_interrupted, pages};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_geometry::io::Unit;
use trocar_reconstruct::truth::{Truth, TruthFigures};
use trocar_reconstruct::{Reconstruction, Settings};
use trocar_recording::Recording;
use trocar_scene::Builtin;
use trocar_specimen::{OrganFacts, Specimen, StagedFolder};

/// The report's name in every folder.
pub const REPORT: &str = "report.html";

/// A reconstructed specimen in figures.
#[derive(Clone, Debug, Serialize)]
pub struct Reconstructed {
    /// The specimen's folder.
    pub specimen: String,
    /// Its organs.
    pub organs: Vec<OrganRow>,
    /// Figures of the composite; `None` for a surface file.
    pub composite: Option<CompositeFigures>,
    /// Warnings that the result may be wrong, one sentence each.
    pub warnings: Vec<String>,
    /// Notes for the user, one sentence each.
    pub notes: Vec<String>,
    /// Wall time (s).
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// One organ in figures.
#[derive(Clone, Debug, Serialize)]
pub struct OrganRow {
    /// Its name.
    pub organ: String,
    /// Its measurements.
    #[serde(flatten)]
    pub facts: OrganFacts,
    /// Share of its pixels that move during the window; `None` for a surface file.
    pub moving_share: Option<f64>,
}

/// The composite in figures.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CompositeFigures {
    /// Frames used.
    pub frames_used: usize,
    /// Share of the image recovered from under instruments.
    pub recovered_share: f64,
    /// Share of pixels with depth.
    pub coverage: f64,
    /// Median over pixels of the 10th to 90th percentile range of depth (mm).
    pub depth_range_median_mm: f64,
    /// Wall time of reading and decoding the frames (s).
    pub frames_s: f64,
    /// Time that all threads together spent decoding images (s).
    pub decoding_cpu_s: f64,
    /// Wall time of the medians (s).
    pub medians_s: f64,
    /// Its errors against the truth, where the recording has one.
    pub truth: Option<TruthFigures>,
}

impl CompositeFigures {
    /// The figures of `r`, with its errors against the `truth`.
    pub fn of(r: &Reconstruction, truth: Option<&Truth>) -> Self {
        let c = &r.composite;
        Self {
            frames_used: c.frames_used,
            recovered_share: c.recovered_share,
            coverage: c.coverage,
            depth_range_median_mm: c.depth_range_median * 1e3,
            frames_s: c.times.frames,
            decoding_cpu_s: c.times.decoding,
            medians_s: c.times.medians,
            truth: truth.and_then(Truth::figures),
        }
    }
}

/// What [`reconstruct_recording`] made.
pub struct ReconstructedRecording {
    /// The specimen in figures.
    pub figures: Reconstructed,
    /// The specimen and how it was found.
    pub reconstruction: Reconstruction,
    /// The truth of the recording, if it has one.
    pub truth: Option<Truth>,
    /// The sections of the report on the reconstruction, see [`pages::reconstruction_sections`].
    pub sections: String,
}

/// Reconstructs the recording in folder `recording` into the specimen folder `output`, with its
/// report.
///
/// # Errors
/// One line that names the file or field of a wrong input; `output` then stays unchanged.
pub fn reconstruct_recording(
    recording: &Path,
    settings: &Settings,
    output: &Path,
    progress: &dyn Progress,
) -> Result<ReconstructedRecording> {
    let clock = Instant::now();
    refuse_overlap(recording, output)?;
    let staged = Specimen::stage(output)?;
    let reconstruction = trocar_reconstruct::reconstruct(&Recording::open(recording)?, settings, progress)?;
    let r = &reconstruction;
    pages::check_sizes(r)?;
    let truth = Truth::read(r, &recording.join("truth"))?;
    let sections = pages::reconstruction_sections(r)?;
    finish(staged, &r.specimen, &pages::reconstruction(r, &sections, truth.as_ref())?, progress)?;
    let composite = CompositeFigures::of(r, truth.as_ref());
    let mut figures = figures(&r.specimen, Some(composite), r.notes.clone(), output, clock);
    figures.warnings.clone_from(&r.warnings);
    for (row, view) in figures.organs.iter_mut().zip(&r.organs) {
        row.moving_share = Some(view.moving_share);
    }
    Ok(ReconstructedRecording { figures, reconstruction, truth, sections })
}

/// Makes the specimen folder `output` from a surface file, with its report.
///
/// # Errors
/// One line that names the file and what is wrong with it; `output` then stays unchanged.
pub fn reconstruct_surface(
    surface: &Path,
    unit: Unit,
    settings: &Settings,
    output: &Path,
    progress: &dyn Progress,
) -> Result<Reconstructed> {
    let clock = Instant::now();
    refuse_overlap(surface, output)?;
    let staged = Specimen::stage(output)?;
    let (specimen, repair) = trocar_reconstruct::from_surface(surface, unit, settings, progress)?;
    finish(staged, &specimen, &pages::surface(&specimen, &repair)?, progress)?;
    let mut notes = Vec::new();
    if repair.rebuilt {
        notes.push(format!(
            "the surface was not watertight ({} open edges, {} components) and was rebuilt",
            repair.open_edges, repair.components
        ));
    }
    Ok(figures(&specimen, None, notes, output, clock))
}

fn finish(staged: StagedFolder, specimen: &Specimen, html: &str, progress: &dyn Progress) -> Result<()> {
    // Making a report does not check for interruption.
    check_interrupted(progress)?;
    specimen.write_into(staged.path())?;
    let path = staged.path().join(REPORT);
    std::fs::write(&path, html).map_err(|source| Error::Io { path, source })?;
    Ok(staged.commit()?)
}

/// Refuses an output that is, contains or is inside the input, which would be replaced or changed.
pub(crate) fn refuse_overlap(input: &Path, output: &Path) -> Result<()> {
    // A missing output is placed by its nearest existing parent.
    let placed = |path: &Path| {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let root = path.ancestors().find_map(|p| Some((p, p.canonicalize().ok()?)));
        root.map_or_else(|| path.clone(), |(p, real)| real.join(path.strip_prefix(p).unwrap_or(Path::new(""))))
    };
    let (from, to) = (placed(input), placed(output));
    if from.starts_with(&to) || (input.is_dir() && to.starts_with(&from)) {
        return Err(Error::Overlap { input: input.to_owned(), output: output.to_owned() });
    }
    Ok(())
}

/// The same for a scene file; a built-in scene, which wins over a file of its name, is no input.
pub fn refuse_scene_overlap(scene: &str, output: &Path) -> Result<()> {
    if Builtin::named(scene).is_some() { Ok(()) } else { refuse_overlap(Path::new(scene), output) }
}

fn figures(
    specimen: &Specimen,
    composite: Option<CompositeFigures>,
    notes: Vec<String>,
    output: &Path,
    clock: Instant,
) -> Reconstructed {
    Reconstructed {
        specimen: output.display().to_string(),
        organs: specimen
            .organs
            .iter()
            .map(|o| OrganRow { organ: o.name.clone(), facts: o.facts, moving_share: None })
            .collect(),
        composite,
        warnings: Vec::new(),
        notes,
        seconds: clock.elapsed().as_secs_f64(),
        report: output.join(REPORT).display().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_built_in_scene_is_not_a_folder_of_its_name() {
        let here = Path::new("cell-a");
        assert!(refuse_scene_overlap("cell-a", here).is_ok());
        assert!(refuse_scene_overlap("cell-a.toml", Path::new("cell-a.toml")).is_err());
        assert!(refuse_overlap(here, here).is_err());
    }
}
