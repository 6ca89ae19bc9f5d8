//! `trocar measure`: grasp-lifts of a recording or of a simulated episode.

mod episode_film;
mod film_file;
mod truth;

pub use truth::{LiftTruthFigures, against_truth};

use crate::{Error, Result};
use episode_film::EpisodeFilm;
pub use film_file::FilmFile;
use glam::DVec2;
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_camera::Mask;
use trocar_core::Progress;
use trocar_measure::{LiftFigures, Line, MeasuredLift, RecordingFilm};
use trocar_phantom::LiftsTruth;
use trocar_reconstruct::truth::quantile;
use trocar_recording::{LiftInfo, Recording};
use trocar_task::EPISODE_FILE;

/// What to measure.
#[derive(Clone, Debug, Default)]
pub struct Measuring {
    /// Recording, or folder of an episode.
    pub source: PathBuf,
    /// Camera of an episode; by default its scene's first.
    pub camera: Option<String>,
    /// Frames of an episode's lift: at rest, first and last.
    pub frames: [Option<usize>; 3],
    /// Pixel on the organ in an episode's frame at rest.
    pub click: Option<[f64; 2]>,
    /// Specimen folder of an episode, if it was moved from its place in the scene.
    pub specimen: Option<PathBuf>,
    /// Folder of made phantoms, for episodes.
    pub phantoms: PathBuf,
    /// Film of a lift to write.
    pub film: Option<FilmFile>,
}

/// One lift with its figures, or why it has none.
#[derive(Clone, Debug, Serialize)]
pub struct LiftRow {
    /// Number of the lift.
    pub lift: usize,
    /// Its figures.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub figures: Option<LiftFigures>,
    /// Why it cannot be measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// The truth of a phantom.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<LiftTruthFigures>,
}

/// The figures of all lifts of a film.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// The recording or episode.
    pub source: String,
    /// Its lifts.
    pub lifts: Vec<LiftRow>,
    /// The line of d50 over lift (mm), from three lifts on.
    pub line: Option<Line>,
    /// Median over lifts of the greatest lift (mm).
    pub lift_mm: Option<f64>,
    /// Median over lifts of d50 (mm).
    pub d50_mm: Option<f64>,
    /// Medians over lifts of the landmark errors (mm): no motion, motion like the apex, and two
    /// frames at the peak.
    pub static_rmse_mm: Option<f64>,
    /// See `static_rmse_mm`.
    pub rigid_rmse_mm: Option<f64>,
    /// See `static_rmse_mm`.
    pub landmark_floor_mm: Option<f64>,
    /// Median distance of tracked points from the truth of a phantom (mm).
    pub tracking_error_mm_median: Option<f64>,
}

/// The lifts of a recording, measured: each with its number, or why it failed.
pub struct MeasuredRecording {
    /// The measured lifts.
    pub lifts: Vec<std::result::Result<MeasuredLift, String>>,
    /// The organ of each.
    pub organs: Vec<String>,
    /// The truth of a phantom.
    pub truth: Option<LiftsTruth>,
}

impl Measuring {
    /// Measures all lifts.
    ///
    /// # Errors
    /// One line that names the file, field or option; an interruption.
    pub fn run(&self, progress: &dyn Progress) -> Result<Measured> {
        if self.source.join(EPISODE_FILE).is_file() {
            return self.episode(progress);
        }
        let other = [
            ("--camera", self.camera.is_some()),
            ("--click", self.click.is_some()),
            ("--specimen", self.specimen.is_some()),
            ("--rest, --first and --last", self.frames.iter().any(Option::is_some)),
        ];
        if let Some((option, _)) = other.into_iter().find(|o| o.1) {
            let reason = format!("{option} is only for episodes; a recording marks its lifts by [[lift]]");
            return Err(Error::Mismatch(format!("{}: {reason}", self.source.display())));
        }
        let recording = Recording::open(&self.source)?;
        self.check_film(recording.info.lifts.len())?;
        let measured = measure_recording(&recording, progress)?;
        if let Some(film) = &self.film {
            let rate_hz = recording.info.rate_hz;
            film.write(&mut RecordingFilm::new(&recording), rate_hz, &measured.lifts[film.lift], progress)?;
        }
        Measured::summary(&recording, &measured)
    }

    /// Refuses a film that cannot be written, before anything is measured.
    fn check_film(&self, lifts: usize) -> Result<()> {
        self.film.as_ref().map_or(Ok(()), |film| film.check(lifts))
    }

    fn episode(&self, progress: &dyn Progress) -> Result<Measured> {
        self.check_film(1)?;
        let film = EpisodeFilm::open(&self.source, self.specimen.as_deref(), &self.phantoms, self.camera.as_deref());
        let mut film = film?;
        let [rest, first, last] = self.frames;
        let end = film.frames.saturating_sub(1);
        let (rest, last) = (rest.unwrap_or(0), last.unwrap_or(end));
        let first = first.unwrap_or(rest + 1);
        if !(rest <= first && first < last && last <= end) {
            return Err(Error::Mismatch(format!(
                "--rest is {rest}, --first {first}, --last {last}; they must rise within the episode's frames 0 to {end}"
            )));
        }
        let mask = film.organ_mask(rest)?;
        let click = self.click.or_else(|| middle(&mask)).ok_or_else(|| {
            Error::Mismatch(format!(
                "{}: its camera does not show organ '{}' in frame {rest}",
                self.source.display(),
                film.organ
            ))
        })?;
        let info = LiftInfo { rest, first, last, click, force_n: None };
        progress.begin("lift", (last - rest + 1) as u64);
        let measured = MeasuredLift::of(&mut film, &info, &mask, None, progress);
        progress.end();
        let measured = match measured {
            Ok(lift) => Ok(lift),
            Err(error @ trocar_measure::Error::Organ { .. }) => Err(error.to_string()),
            Err(error) => return Err(error.into()),
        };
        if let Some(file) = &self.film {
            let rate_hz = Some(film.rate_hz);
            file.write(&mut film, rate_hz, &measured, progress)?;
        }
        let row = match measured {
            Ok(lift) => LiftRow { lift: 0, figures: Some(LiftFigures::of(&lift)), failure: None, truth: None },
            Err(reason) => LiftRow { lift: 0, figures: None, failure: Some(reason), truth: None },
        };
        Ok(Measured::of(&self.source, vec![row], &[]))
    }
}

/// Measures the lifts of a recording.
///
/// # Errors
/// A recording without lifts, a click on no organ, an unreadable file, an interruption.
pub fn measure_recording(recording: &Recording, progress: &dyn Progress) -> Result<MeasuredRecording> {
    let lifts = &recording.info.lifts;
    let wrong = |reason: String| Error::Mismatch(format!("{}: {reason}", recording.toml().display()));
    if lifts.is_empty() {
        return Err(wrong("there is no [[lift]]; add rest, first, last and click of each lift".into()));
    }
    let mut masks: Vec<(Mask, Option<[f64; 2]>, &str)> = Vec::new();
    for organ in &recording.info.organs {
        masks.extend(
            trocar_reconstruct::drawn_mask(recording, organ)?.map(|mask| (mask, organ.base_px, organ.name.as_str())),
        );
    }
    let organ = |lift: &LiftInfo| {
        let [u, v] = lift.click.map(|c| c.round() as usize);
        masks.iter().find(|(mask, ..)| mask.set.get(v * mask.width + u).copied().unwrap_or(false))
    };
    let chosen = lifts.iter().enumerate().map(|(i, lift)| {
        let [u, v] = lift.click;
        organ(lift).ok_or_else(|| {
            wrong(format!("lift[{i}].click is [{u}, {v}]; it must be on the mask or polygon of an [[organ]]"))
        })
    });
    let chosen = chosen.collect::<Result<Vec<_>>>()?;
    let mut film = RecordingFilm::new(recording);
    let (mut measured, mut organs) = (Vec::new(), Vec::new());
    progress.begin("lifts", lifts.iter().map(|l| (l.last - l.rest + 1) as u64).sum());
    for (info, (mask, base, organ)) in lifts.iter().zip(chosen) {
        organs.push((*organ).to_owned());
        match MeasuredLift::of(&mut film, info, mask, *base, progress) {
            Ok(lift) => measured.push(Ok(lift)),
            Err(error @ trocar_measure::Error::Organ { .. }) => measured.push(Err(error.to_string())),
            Err(error) => {
                progress.end();
                return Err(error.into());
            }
        }
    }
    progress.end();
    Ok(MeasuredRecording { lifts: measured, organs, truth: LiftsTruth::read(&recording.dir().join("truth"))? })
}

/// The pixel of a mask that is nearest to its middle.
fn middle(mask: &Mask) -> Option<[f64; 2]> {
    let place = |i: usize| DVec2::new((i % mask.width) as f64, (i / mask.width) as f64);
    let set: Vec<DVec2> = (0..mask.set.len()).filter(|i| mask.set[*i]).map(place).collect();
    let middle = set.iter().sum::<DVec2>() / set.len().max(1) as f64;
    let near = |p: &DVec2| p.distance_squared(middle);
    set.into_iter().min_by(|a, b| near(a).total_cmp(&near(b))).map(|p| p.to_array())
}

impl Measured {
    /// The figures of the measured lifts of a recording, beside the truth of a phantom.
    ///
    /// # Errors
    /// Names the file of the truth that is missing or broken.
    pub fn summary(recording: &Recording, measured: &MeasuredRecording) -> Result<Self> {
        let folder = recording.dir().join("truth");
        let (mut rows, mut errors) = (Vec::new(), Vec::new());
        for (number, lift) in measured.lifts.iter().enumerate() {
            let mut row = LiftRow { lift: number, figures: None, failure: None, truth: None };
            match lift {
                Err(reason) => row.failure = Some(reason.clone()),
                Ok(lift) => {
                    row.figures = Some(LiftFigures::of(lift));
                    if let Some(known) = measured.truth.as_ref().and_then(|t| t.lifts.get(number)) {
                        let (figures, distances) = against_truth(lift, known, number, &folder)?;
                        errors.extend(distances);
                        row.truth = Some(figures);
                    }
                }
            }
            rows.push(row);
        }
        Ok(Self::of(recording.dir(), rows, &errors))
    }

    fn of(source: &Path, lifts: Vec<LiftRow>, errors: &[f64]) -> Self {
        let figures: Vec<LiftFigures> = lifts.iter().filter_map(|l| l.figures.clone()).collect();
        let middle = |of: &dyn Fn(&LiftFigures) -> Option<f64>| {
            trocar_core::median(figures.iter().filter_map(of).collect::<Vec<_>>())
        };
        Self {
            source: source.display().to_string(),
            line: LiftFigures::line(&figures),
            lift_mm: middle(&|l| l.lift_mm),
            d50_mm: middle(&|l| l.d50_mm),
            static_rmse_mm: middle(&|l| l.static_rmse_mm),
            rigid_rmse_mm: middle(&|l| l.rigid_rmse_mm),
            landmark_floor_mm: middle(&|l| l.landmark_floor_mm),
            tracking_error_mm_median: quantile(errors, 0.5),
            lifts,
        }
    }
}
