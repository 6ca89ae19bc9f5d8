//! `trocar episode`, `trocar replay` and `trocar sweep`: from scenes and files to folders and verdicts.

use crate::phantoms::scene_specimen;
use crate::workflow::refuse_overlap;
use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_specimen::{Specimen, StagedFolder};
use trocar_task::{
    CHANNELS_FILE, EPISODE_FILE, Episode, EpisodeFile, EpisodeResult, GateRange, RESULT_FILE, Sweep, Verdict, policy,
    read_channels, run, sweep,
};

/// One episode of a scene by a policy.
#[derive(Clone, Debug)]
pub struct EpisodeRun {
    /// Scene file or name of a built-in scene.
    pub scene: String,
    /// Name of the policy; see [`policy::POLICIES`].
    pub policy: String,
    /// The episode's seed.
    pub seed: u64,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
}

/// An episode that was run, in figures.
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeMade {
    /// The figures.
    #[serde(flatten)]
    pub result: EpisodeResult,
    /// Wall time of the episode [s], its reset included.
    pub wall_s: f64,
    /// Simulated over wall time.
    pub real_time_factor: f64,
    /// Its folder.
    pub folder: String,
}

impl EpisodeRun {
    /// Runs it into the folder `output`: episode file, channels and result.
    ///
    /// # Errors
    /// One line that names the file, field or option; `output` is then left as it was.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<EpisodeMade> {
        let mut chosen = policy::named(&self.policy)?;
        let scene = Scene::read(&self.scene)?;
        refuse_overlap(Path::new(&self.scene), output)?;
        let staged = StagedFolder::create(output, RESULT_FILE)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut episode = Episode::new(&scene, &specimen, self.threads)?;
        let periods = scene.task.episode_s / episode.cell().period();
        progress.begin("episode", periods.round() as u64);
        let clock = Instant::now();
        let recording = run(&mut episode, chosen.as_mut(), self.seed, &mut |_| {
            progress.advance(1);
            !progress.interrupted()
        })?;
        let wall_s = clock.elapsed().as_secs_f64();
        progress.end();
        recording.write_into(staged.path())?;
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        staged.commit()?;
        let real_time_factor = recording.summary.duration_s / wall_s.max(1e-9);
        let folder = output.display().to_string();
        Ok(EpisodeMade { result: recording.result(), wall_s, real_time_factor, folder })
    }
}

/// `name` in the folder `path`, or `path` itself where it is no folder.
fn inside(path: &Path, name: &str) -> PathBuf {
    if path.is_dir() { path.join(name) } else { path.to_owned() }
}

/// The episode in a file, or in an episode's folder.
///
/// # Errors
/// A file that is missing or damaged.
pub fn read_episode(path: &Path) -> Result<EpisodeFile> {
    Ok(EpisodeFile::read(&inside(path, EPISODE_FILE))?)
}

/// Does the episode in `file` again and compares every step. The specimen is the scene's, or that in the folder `specimen`.
///
/// # Errors
/// A file that is damaged, a scene or specimen that cannot be built. What differs is a verdict.
pub fn replay(
    file: &Path,
    specimen: Option<&Path>,
    phantoms: &Path,
    threads: usize,
    progress: &dyn Progress,
) -> Result<Verdict> {
    let episode = read_episode(file)?;
    let scene = episode.scene(specimen)?;
    let specimen = match specimen {
        Some(folder) => Specimen::read(folder)?,
        None => scene_specimen(&scene, phantoms, progress)?,
    };
    progress.begin("replay", episode.steps.len() as u64);
    let verdict = episode.verify(&scene, &specimen, threads, &mut || {
        progress.advance(1);
        !progress.interrupted()
    })?;
    progress.end();
    Ok(verdict)
}

/// Judges stored channels at every combination of the gates that `ranges` say.
///
/// # Errors
/// A file that is damaged or named twice, a range that cannot be read.
pub fn sweep_files(files: &[PathBuf], ranges: &[String], progress: &dyn Progress) -> Result<Sweep> {
    let ranges: Vec<GateRange> = ranges.iter().map(|r| GateRange::parse(r)).collect::<std::result::Result<_, _>>()?;
    if let Some((_, twice)) = files.iter().enumerate().find(|(k, f)| files[..*k].contains(f)) {
        return Err(Error::Mismatch(format!("{}: named twice; it would count twice", twice.display())));
    }
    let files: Vec<PathBuf> = files.iter().map(|f| inside(f, CHANNELS_FILE)).collect();
    progress.begin("channels", files.len() as u64);
    let mut episodes = Vec::with_capacity(files.len());
    for file in &files {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        episodes.push(read_channels(file)?);
        progress.advance(1);
    }
    progress.end();
    let combinations = ranges.iter().fold(1_u64, |n, r| n.saturating_mul(r.values.len() as u64));
    progress.begin("gates", combinations);
    let swept = sweep(&episodes, &ranges, &mut || {
        progress.advance(1);
        !progress.interrupted()
    })?;
    progress.end();
    Ok(swept)
}
