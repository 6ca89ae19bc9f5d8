//! `trocar identify`: what holds an organ and how stiff it is, from the lifts of a recording.

mod page;

use crate::lift_film::{LiftFilm, ShownLift, Simulated};
use crate::measure::measure_recording;
use crate::reconstruct::{REPORT, refuse_overlap};
use crate::{Error, Result, check_interrupted};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_identify::{FINER, Grip, Identification, Identified, LoneOrgan, Pace, SeenLift, default_priors};
use trocar_measure::RecordingFilm;
use trocar_recording::Recording;
use trocar_specimen::{Organ, Parameter, Posterior, Specimen};

/// Cells in which lifts can be simulated (m).
const CELLS: std::ops::RangeInclusive<f64> = 1e-3..=10e-3;

/// What to identify.
#[derive(Clone, Debug)]
pub struct Identifying {
    /// The recording.
    pub recording: PathBuf,
    /// A specimen of it; reconstructed if `None`.
    pub specimen: Option<PathBuf>,
    /// The organ; that of the first lift if `None`.
    pub organ: Option<String>,
    /// Numbers of the lifts; all if empty.
    pub lifts: Vec<usize>,
    /// Cells of the coarse mesh in which lifts are simulated (m); the finer one follows from it.
    pub cell: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Worker threads; 0 for one a core. The result does not depend on it.
    pub threads: usize,
}

/// One parameter.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterFigures {
    /// Which it is.
    pub parameter: Parameter,
    /// The range of the prior.
    pub range: [f64; 2],
    /// The 5%, 50% and 95% quantiles.
    pub interval: [f64; 3],
    /// The value that explains the lifts best with the others, which the specimen has.
    pub best: f64,
    /// Width of the 90% interval over that of the prior.
    pub width: f64,
    /// Whether that is at most a half.
    pub identified: bool,
}

/// What was identified, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifyResult {
    /// The recording.
    pub recording: String,
    /// The specimen's folder.
    pub specimen: String,
    /// The organ.
    pub organ: String,
    /// The numbers of the lifts.
    pub lifts: Vec<usize>,
    /// Landmarks that are seen in them.
    pub landmarks: usize,
    /// The parameters.
    pub parameters: Vec<ParameterFigures>,
    /// Root mean square landmark error over these lifts with the best values (mm), and with the
    /// specimen as it was reconstructed.
    pub landmark_rmse_mm: Option<f64>,
    /// See `landmark_rmse_mm`.
    pub reconstructed_rmse_mm: Option<f64>,
    /// Error of the model over the lift: median of the posterior.
    pub model_error: f64,
    /// Nodes of the mesh in which lifts were simulated.
    pub nodes: usize,
    /// Simulated values, and those that diverged.
    pub simulated: usize,
    /// See `simulated`.
    pub diverged: usize,
    /// Sentences for people.
    pub notes: Vec<String>,
    /// Wall time (s).
    pub seconds: f64,
    /// The page.
    pub report: String,
}

impl Identifying {
    /// Identifies, and writes the specimen with its page into the folder `output`.
    ///
    /// # Errors
    /// A recording without lifts, an option out of range, too few landmarks, an interruption;
    /// `output` then stays unchanged.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<IdentifyResult> {
        let clock = Instant::now();
        if !CELLS.contains(&self.cell) {
            let reason = format!("--cell is {} mm; it must be in [1, 10]", 1e3 * self.cell);
            return Err(Error::Mismatch(reason));
        }
        refuse_overlap(&self.recording, output)?;
        let staged = Specimen::stage(output)?;
        let recording = Recording::open(&self.recording)?;
        let measured = measure_recording(&recording, progress)?;
        let name = self.organ_name(&measured.organs)?;
        if let Some(number) = self.lifts.iter().find(|n| **n >= measured.lifts.len()) {
            let last = measured.lifts.len() - 1;
            return Err(Error::Mismatch(format!("--lifts names lift {number}; the recording has lifts 0 to {last}")));
        }
        let mut specimen = match &self.specimen {
            Some(folder) => Specimen::read(folder)?,
            None => {
                let settings = trocar_reconstruct::Settings::default();
                trocar_reconstruct::reconstruct(&recording, &settings, progress)?.specimen
            }
        };
        let organ = LoneOrgan::of(&specimen, &name)?;
        let (mut seen, mut notes) = (Vec::new(), Vec::new());
        for (number, (lift, of)) in measured.lifts.into_iter().zip(&measured.organs).enumerate() {
            if *of != name || !(self.lifts.is_empty() || self.lifts.contains(&number)) {
                continue;
            }
            match lift.map(|lift| SeenLift::of(lift, &organ)) {
                Ok(Some(lift)) => seen.push((number, lift)),
                Ok(None) => notes.push(format!("lift {number} is left out: too little of it is seen")),
                Err(why) => notes.push(format!("lift {number} is left out: {why}")),
            }
        }
        let identification = Identification {
            organ: organ.meshed(self.cell)?,
            finer: organ.meshed(FINER * self.cell)?,
            lifts: seen.iter().map(|(number, lift)| lift.observation(*number)).collect(),
            priors: default_priors(),
            seed: self.seed,
            recording: self.recording.display().to_string(),
            threads: self.threads,
        };
        let found = identification.run(progress)?;
        progress.begin("comparison", 2);
        let rmse = |change: &dyn Fn(&mut Organ)| error_of(&organ.with(change), &seen, progress);
        let reconstructed_rmse_mm = rmse(&|_| {})?;
        progress.advance(1);
        let landmark_rmse_mm = rmse(&|organ| Posterior::apply(&found.best, organ))?;
        progress.advance(1);
        progress.end();
        let film = match Simulated::not_shown(&specimen, &recording.camera()) {
            // A film that cannot be made is no reason to lose what was identified.
            None => match film(&recording, &specimen, &organ, &found, &seen, progress) {
                Err(Error::Interrupted) => return Err(Error::Interrupted),
                film => film.map_err(|error| error.to_string()),
            },
            Some(why) => Err(why.to_owned()),
        };
        let film = film.unwrap_or_else(|why| {
            notes.push(format!("there is no film of a lift: {why}"));
            None
        });
        notes.extend(said(&found, identification.lifts.iter().any(|l| l.force.is_some())));
        if let Some(organ) = specimen.organs.iter_mut().find(|o| o.name == name) {
            Posterior::apply(&found.best, organ);
            organ.posterior = Some(found.posterior.clone());
        }
        let result = IdentifyResult {
            recording: self.recording.display().to_string(),
            specimen: output.display().to_string(),
            organ: name,
            lifts: seen.iter().map(|(number, _)| *number).collect(),
            landmarks: identification.lifts.iter().map(|l| l.landmarks.len()).sum(),
            parameters: parameters(&found),
            landmark_rmse_mm,
            reconstructed_rmse_mm,
            model_error: found.model_error,
            nodes: identification.organ.organ().body.vertices.len(),
            simulated: found.simulated,
            diverged: found.diverged,
            notes,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        let page = page::document(&result, &found, film.as_ref())?.page();
        check_interrupted(progress)?;
        specimen.write_into(staged.path())?;
        let path = staged.path().join(REPORT);
        std::fs::write(&path, page).map_err(|source| Error::Io { path, source })?;
        staged.commit()?;
        Ok(result)
    }

    /// The organ to identify, of those that are lifted.
    fn organ_name(&self, lifted: &[String]) -> Result<String> {
        match (&self.organ, lifted.first()) {
            (Some(name), _) if lifted.contains(name) => Ok(name.clone()),
            (Some(name), _) => {
                let mut known: Vec<&str> = lifted.iter().map(String::as_str).collect();
                known.sort_unstable();
                known.dedup();
                let reason = format!("--organ is '{name}', which no lift lifts; the lifts are of {}", known.join(", "));
                Err(Error::Mismatch(reason))
            }
            (None, Some(first)) => Ok(first.clone()),
            (None, None) => Err(Error::Mismatch("the recording has no lifts".to_owned())),
        }
    }
}

/// The film of the lift with the longest way and its number, beside the same lift with the best
/// values.
fn film(
    recording: &Recording,
    specimen: &Specimen,
    organ: &LoneOrgan,
    found: &Identified,
    seen: &[(usize, SeenLift)],
    progress: &dyn Progress,
) -> Result<Option<(usize, LiftFilm)>> {
    let way = |lift: &SeenLift| lift.displacement.length();
    let Some((number, seen)) = seen.iter().max_by(|a, b| way(&a.1).total_cmp(&way(&b.1)).then(b.0.cmp(&a.0))) else {
        return Ok(None);
    };
    let organ = organ.with(|organ| Posterior::apply(&found.best, organ));
    let made = Simulated { specimen, organ: &organ, seen, grip: Grip::Place };
    let lift = ShownLift { number: *number, rate_hz: recording.info.rate_hz, lift: &seen.lift };
    Ok(Some((*number, lift.film(&mut RecordingFilm::new(recording), Some(&made), progress)?)))
}

/// Root mean square landmark error of an organ over lifts (mm); `None` if one diverges.
fn error_of(organ: &LoneOrgan, seen: &[(usize, SeenLift)], progress: &dyn Progress) -> Result<Option<f64>> {
    let pulls: Vec<_> = seen.iter().map(|(_, lift)| lift.pull(Grip::Place)).collect();
    let lifted = organ.lift(&pulls, Pace::QUICK, progress)?;
    let one = |((_, lift), lifted): (&(usize, SeenLift), &Option<_>)| lift.compared(organ, lifted.as_ref()?)[0];
    let errors: Option<Vec<f64>> = seen.iter().zip(&lifted).map(one).collect();
    Ok(errors.map(|all| 1e3 * (all.iter().map(|e| e * e).sum::<f64>() / all.len().max(1) as f64).sqrt()))
}

fn parameters(found: &Identified) -> Vec<ParameterFigures> {
    let figures = |(prior, (_, best)): (&trocar_specimen::Prior, &(Parameter, f64))| ParameterFigures {
        parameter: prior.name,
        range: prior.range,
        interval: prior.interval,
        best: *best,
        width: prior.width,
        identified: Posterior::is_identified(prior),
    };
    found.posterior.parameters.iter().zip(&found.best).map(figures).collect()
}

/// What lifts tell and what not, in sentences.
fn said(found: &Identified, forces: bool) -> Vec<String> {
    let told: Vec<&trocar_specimen::Prior> = found.posterior.parameters.iter().collect();
    let names = |identified: bool| -> String {
        let some = told.iter().filter(|p| Posterior::is_identified(p) == identified);
        some.map(|p| p.name.said().0).collect::<Vec<_>>().join(", ")
    };
    let mut lines = Vec::new();
    if !names(true).is_empty() {
        lines.push(format!("identified: {} (90% interval at most half as wide as before)", names(true)));
    }
    if !names(false).is_empty() {
        lines.push(format!("not identified: {}; their intervals stay wide", names(false)));
    }
    let modulus = told.iter().find(|p| p.name == Parameter::YoungModulus);
    if modulus.is_some_and(|p| !Posterior::is_identified(p)) {
        let alone = if forces { "by these lifts" } else { "by geometry alone; a measured force (force_n) would tell" };
        lines.push(format!("stiffness not identified {alone}"));
    } else if !forces {
        lines.push(
            "no force was measured: the organ's weight, with its density, sets the scale of stiffness".to_owned(),
        );
    }
    lines
}
