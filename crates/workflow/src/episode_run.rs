//! `trocar episode`, `trocar replay` and `trocar sweep`.

use crate::pages;
use crate::phantoms::recorded_specimen;
use crate::reconstruct::{REPORT, refuse_scene_overlap};
use crate::recorder::Recorder;
use crate::specimen_cache::{SpecimenCache, drawn_specimens};
use crate::surfaces::{SURFACES_FILE, SurfaceWatch};
use crate::{Error, Result, check_interrupted};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_scene::{Scene, VariationSet};
use trocar_sensors::CameraRig;
use trocar_specimen::StagedFolder;
use trocar_task::{
    CHANNELS_FILE, EPISODE_FILE, Episode, EpisodeFile, EpisodeResult, GateRange, Policy, RESULT_FILE, Sweep, Verdict,
    policy, read_channels, run_watched, sweep,
};

/// One episode of a scene by a policy.
#[derive(Clone, Debug)]
pub struct EpisodeRun {
    /// Scene file or name of a built-in scene.
    pub scene: String,
    /// Name of the policy, one of [`policy::POLICIES`]; [`run_policy`](Self::run_policy) ignores
    /// it.
    pub policy: String,
    /// The episode's seed.
    pub seed: u64,
    /// The set of factors that vary, instead of the scene's.
    pub variation: Option<VariationSet>,
    /// Keep the surfaces of every control period, see [`crate::surfaces`].
    pub surfaces: bool,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Folder of made phantoms. The scene's phantom is made there once and reused.
    pub phantoms: PathBuf,
}

/// The figures of a finished episode.
#[derive(Clone, Debug, Serialize)]
pub struct EpisodeOutput {
    /// The contents of its `result.json`.
    #[serde(flatten)]
    pub result: EpisodeResult,
    /// Wall time of the episode (s), with its reset and without pictures.
    pub wall_s: f64,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    /// The episode's folder.
    pub folder: String,
    /// The page's path.
    pub report: String,
}

impl EpisodeRun {
    /// Runs the episode and writes episode file, channels, result and page into the folder
    /// `output`.
    ///
    /// # Errors
    /// One line that names the file, field or option; `output` then stays unchanged.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<EpisodeOutput> {
        let chosen = policy::named(&self.policy)?;
        self.run_policy(output, progress, |_| Ok(chosen))
    }

    /// Checks the scene and the folder `output`, before anything is built.
    ///
    /// # Errors
    /// A scene that cannot be read; a folder with other contents.
    pub fn check(&self, output: &Path) -> Result<Scene> {
        let scene = read_varied(&self.scene, self.variation, VariationSet::None)?;
        refuse_scene_overlap(&self.scene, output)?;
        // The staged folder is removed when it is dropped.
        StagedFolder::create(output, RESULT_FILE)?;
        Ok(scene)
    }

    /// Runs the episode by the policy that `make` returns.
    ///
    /// # Errors
    /// As [`run`](Self::run); an error of `make`.
    pub fn run_policy(
        &self,
        output: &Path,
        progress: &dyn Progress,
        make: impl FnOnce(&Episode) -> Result<Box<dyn Policy + Send>>,
    ) -> Result<EpisodeOutput> {
        let scene = self.check(output)?;
        let staged = StagedFolder::create(output, RESULT_FILE)?;
        let specimens = SpecimenCache::new(&scene, &self.phantoms);
        specimens.make_all(&drawn_specimens(&scene, std::iter::once(self.seed)), progress)?;
        let drawn = scene.draw(self.seed);
        let episode = Episode::begun(&scene, Box::new(specimens), self.threads, self.seed, drawn);
        let mut episode = episode?;
        let mut chosen = make(&episode)?;
        let rig = CameraRig::new(episode.arranged_scene(), episode.specimen(), episode.cell())?;
        let mut recorder = Recorder::new(rig).stills_only();
        let mut surfaces = SurfaceWatch::new(self.surfaces);
        let periods = scene.task.episode_s / episode.cell().period();
        progress.begin("episode", periods.round() as u64);
        let clock = Instant::now();
        let recording = run_watched(&mut episode, chosen.as_mut(), self.seed, &mut |episode, step| {
            recorder.record(episode, step);
            surfaces.see(episode, step);
            progress.advance(u64::from(step.is_some()));
            !progress.interrupted()
        })?;
        let wall_s = (clock.elapsed() - recorder.spent() - surfaces.spent()).as_secs_f64();
        progress.end();
        let pictures = recorder.finish(episode.cell())?;
        if let Some(bytes) = surfaces.finish()? {
            let path = staged.path().join(SURFACES_FILE);
            std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })?;
        }
        recording.write_into(staged.path())?;
        let real_time_factor = recording.summary.duration_s / wall_s.max(1e-9);
        let page = pages::episode(&recording, &pictures, real_time_factor)?;
        let path = staged.path().join(REPORT);
        std::fs::write(&path, page).map_err(|source| Error::Io { path, source })?;
        check_interrupted(progress)?;
        staged.commit()?;
        let (folder, report) = (output.display().to_string(), output.join(REPORT).display().to_string());
        Ok(EpisodeOutput { result: recording.result(), wall_s, real_time_factor, folder, report })
    }
}

/// The scene at `path` or of that name, with the set `variation` instead of its own. Without one, a
/// scene that has no set varies by `default`.
///
/// # Errors
/// A scene that cannot be read, or that the set does not suit.
pub fn read_varied(path: &str, variation: Option<VariationSet>, default: VariationSet) -> Result<Scene> {
    let mut scene = Scene::read(path)?;
    let chosen = scene.variation.chosen(variation, default);
    if chosen != scene.variation {
        scene.variation = chosen;
        scene.validate()?;
    }
    Ok(scene)
}

/// The file `name` in the folder `path`, or `path` itself if it is no folder.
fn inside(path: &Path, name: &str) -> Result<PathBuf> {
    if !path.exists() {
        let right = format!("name the folder of an episode, or its {name}");
        return Err(Error::Mismatch(format!("{}: no such file or folder; {right}", path.display())));
    }
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let file = path.join(name);
    if file.is_file() {
        return Ok(file);
    }
    Err(Error::Mismatch(format!("{}: the folder has no {name}; name the folder of an episode", path.display())))
}

/// Reads an episode from its file or folder.
///
/// # Errors
/// A file that is missing or damaged.
pub fn read_episode(path: &Path) -> Result<EpisodeFile> {
    Ok(EpisodeFile::read(&inside(path, EPISODE_FILE)?)?)
}

/// Replays the episode in `file` and compares every step. The specimen is that of the scene, or the
/// one in the folder `specimen`.
///
/// # Errors
/// A file that is damaged, a scene or specimen that cannot be built. A difference is no error.
pub fn replay(
    file: &Path,
    specimen: Option<&Path>,
    phantoms: &Path,
    threads: usize,
    progress: &dyn Progress,
) -> Result<Verdict> {
    let episode = read_episode(file)?;
    let scene = episode.scene(specimen)?;
    let specimen = recorded_specimen(&scene, specimen, phantoms, progress)?;
    progress.begin("replay", episode.steps.len() as u64);
    let verdict = episode.verify(&scene, &specimen, threads, &mut || {
        progress.advance(1);
        !progress.interrupted()
    })?;
    progress.end();
    Ok(verdict)
}

/// Scores stored channels at every combination of the gates in `ranges`.
///
/// # Errors
/// A file that is damaged or named twice, a range that cannot be read.
pub fn sweep_files(files: &[PathBuf], ranges: &[String], progress: &dyn Progress) -> Result<Sweep> {
    let ranges: Vec<GateRange> = ranges.iter().map(|r| GateRange::parse(r)).collect::<std::result::Result<_, _>>()?;
    if let Some((_, twice)) = files.iter().enumerate().find(|(k, f)| files[..*k].contains(f)) {
        return Err(Error::Mismatch(format!("{}: given twice; name each file once", twice.display())));
    }
    let files: Vec<PathBuf> = files.iter().map(|f| inside(f, CHANNELS_FILE)).collect::<Result<_>>()?;
    progress.begin("channels", files.len() as u64);
    let mut episodes = Vec::with_capacity(files.len());
    for file in &files {
        check_interrupted(progress)?;
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
