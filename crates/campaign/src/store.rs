//! Finished episodes on disk. Each has its own folder, which appears whole or not at all.

use crate::manifest::{self, Job, Manifest};
use crate::policy_spec::PolicySpec;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use trocar_scene::{Split, Variation};
use trocar_task::{ArmSummary, CHANNELS_FILE, EPISODE_FILE, End, RESULT_FILE, Recording, Summary, read_channels};
use trocar_workflow::{Error, Result, SURFACES_FILE};

/// The file whose presence makes a folder a campaign.
const MANIFEST: &str = "campaign.json";
/// Folders of finished episodes and of files that are being written.
const EPISODES: &str = "episodes";
const IN_PROGRESS: &str = "under-way";
/// A file that the writing process locks.
const LOCK: &str = ".lock";

/// The files of an episode: name and bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EpisodeFiles(pub Vec<(String, Vec<u8>)>);

impl EpisodeFiles {
    /// The files of a finished episode, with its surfaces if they are kept.
    ///
    /// # Errors
    /// A temporary folder that cannot be written.
    pub fn of(recording: &Recording, surfaces: Option<Vec<u8>>) -> Result<Self> {
        let io = |source| Error::Io { path: std::env::temp_dir(), source };
        let folder = tempfile::tempdir().map_err(io)?;
        recording.write_into(folder.path())?;
        let names = [EPISODE_FILE, CHANNELS_FILE, RESULT_FILE];
        let read = |name: &str| {
            let path = folder.path().join(name);
            fs::read(&path).map(|bytes| (name.to_owned(), bytes)).map_err(|source| Error::Io { path, source })
        };
        let mut files = names.into_iter().map(read).collect::<Result<Vec<_>>>()?;
        files.extend(surfaces.map(|bytes| (SURFACES_FILE.to_owned(), bytes)));
        Ok(Self(files))
    }
}

/// A stored episode: its `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeRecord {
    /// Name of its policy.
    #[serde(default)]
    pub name: String,
    /// Index among the policy's episodes.
    #[serde(default)]
    pub index: usize,
    /// The seed.
    pub seed: u64,
    /// Hash of the final state.
    pub state_hash: String,
    /// Its figures.
    #[serde(flatten)]
    pub summary: Summary,
}

impl EpisodeRecord {
    /// Median RCM deviation under load (mm) of the arm that was longest under load. `None` if no
    /// arm was under load.
    pub fn loaded_rcm_mm(&self) -> Option<f64> {
        let arms = self.summary.arms.iter().filter(|a| a.loaded_s > 0.0);
        arms.max_by(|a, b| a.loaded_s.total_cmp(&b.loaded_s)).and_then(|a| a.rcm_median_mm)
    }

    /// Delay of the measured tip behind the commanded tip (ms), of the arm with the largest
    /// tracking error without load. `None` if no arm has a tracking error.
    pub fn lag_ms(&self) -> Option<f64> {
        let arms =
            self.summary.arms.iter().filter_map(|a| Some((a.tracking_rms_mm.filter(|mm| *mm > 0.0)?, a.lag_ms?)));
        arms.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, lag)| lag)
    }

    /// Why it did not pass, in words; its end if there is no reason.
    pub(crate) fn why(&self) -> String {
        let end = || self.summary.end.as_ref().map_or("no end".to_owned(), ToString::to_string);
        self.summary.why.clone().unwrap_or_else(end)
    }

    /// The maximum of `of` over the arms.
    pub(crate) fn peak(&self, of: fn(&ArmSummary) -> f64) -> f64 {
        self.summary.arms.iter().map(of).fold(0.0, f64::max)
    }
}

/// A campaign's folder.
pub struct Store {
    folder: PathBuf,
    /// Held as long as the store lives: only one process writes.
    _lock: fs::File,
}

/// Path of an episode's video in the campaign's folder.
pub(super) fn video_name(policy: &str, index: usize) -> String {
    format!("pictures/{policy}-{index:06}.webp")
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
    |source| Error::Io { path: path.to_owned(), source }
}

/// The manifest of the campaign in `folder`; `None` if there is no campaign.
fn read_manifest(folder: &Path) -> Result<Option<Manifest>> {
    let path = folder.join(MANIFEST);
    let exists = |reason: String| Error::Exists { path: folder.to_owned(), reason };
    match fs::read(&path) {
        Ok(text) => {
            let manifest =
                serde_json::from_slice(&text).map_err(|e| exists(format!("holds a damaged {MANIFEST}: {e}")))?;
            return Ok(Some(manifest));
        }
        // A file that cannot be read must not count as missing.
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(io(&path)(e)),
        Err(_) => {}
    }
    if folder.is_dir() {
        // A campaign that was killed before it wrote its manifest has only these, and they are
        // empty.
        let own = |name: &std::ffi::OsStr| [EPISODES, IN_PROGRESS, LOCK].iter().any(|own| name == *own);
        for entry in fs::read_dir(folder).map_err(io(folder))? {
            if !own(&entry.map_err(io(folder))?.file_name()) {
                return Err(exists(format!(
                    "is not empty and is no campaign ({MANIFEST} is missing); choose a new folder"
                )));
            }
        }
    }
    Ok(None)
}

/// Checks that `folder` can hold a campaign of `policies` that begins at `seed` of `split` and
/// varies by `variation`, without its specimen.
pub(super) fn check_compatible(
    folder: &Path,
    policies: &[PolicySpec],
    (split, seed): (Split, u64),
    variation: &Variation,
) -> Result<()> {
    let Some(old) = read_manifest(folder)? else { return Ok(()) };
    let exists = |reason: String| Err(Error::Exists { path: folder.to_owned(), reason });
    // Files of earlier programs lack the fields that are compared next.
    let other = [
        ("program", old.program != manifest::program()),
        ("seed", old.seed != seed),
        ("split", old.split != split),
        ("variation", old.variation != *variation),
    ];
    if let Some((what, _)) = other.iter().find(|(_, differs)| *differs) {
        return exists(format!("is a campaign of another {what}; choose another folder"));
    }
    let changed = |p: &&PolicySpec| old.policies.iter().any(|o| o.name == p.name && !p.matches(o));
    if let Some(policy) = policies.iter().find(changed) {
        return exists(format!("has episodes of another policy named '{}'; name this one differently", policy.name));
    }
    Ok(())
}

/// Whether `folder` has `count` episodes of a policy `name`. Does not read them.
pub(super) fn has_episodes(folder: &Path, name: &str, count: usize) -> bool {
    let episodes = folder.join(EPISODES).join(name);
    (0..count).all(|index| episodes.join(format!("{index:06}")).join(RESULT_FILE).is_file())
}

impl Store {
    /// Opens or creates the campaign in `folder`. An existing campaign may get more episodes and
    /// other policies, but not another scene, specimen, variation, split or seed.
    ///
    /// # Errors
    /// A folder with other contents or another campaign; one that another process writes.
    pub fn open(folder: &Path, manifest: &Manifest) -> Result<Self> {
        let exists = |reason: String| Error::Exists { path: folder.to_owned(), reason };
        // Nothing is written into a folder with other contents.
        read_manifest(folder)?;
        let episodes = folder.join(EPISODES);
        fs::create_dir_all(&episodes).map_err(io(&episodes))?;
        let lock_path = folder.join(LOCK);
        let lock = fs::File::create(&lock_path).map_err(io(&lock_path))?;
        if lock.try_lock().is_err() {
            return Err(exists("is being written by another process".to_owned()));
        }
        // Another process may have changed the manifest before the lock was held.
        let mut whole = manifest.clone();
        whole.policies = manifest.policies.iter().map(PolicySpec::redacted).collect();
        if let Some(old) = read_manifest(folder)? {
            check_compatible(folder, &manifest.policies, (manifest.split, manifest.seed), &manifest.variation)?;
            let other = [
                ("scene", old.scene_hash != manifest.scene_hash),
                ("specimen", old.specimen_hash != manifest.specimen_hash),
            ];
            if let Some((what, _)) = other.iter().find(|(_, differs)| *differs) {
                return Err(exists(format!("is a campaign of another {what}; choose another folder")));
            }
            // Stored episodes of policies that are not part of this run stay valid.
            let others = old.policies.into_iter().filter(|o| manifest.policies.iter().all(|p| p.name != o.name));
            whole.policies.extend(others);
        }
        let under_way = folder.join(IN_PROGRESS);
        if under_way.exists() {
            fs::remove_dir_all(&under_way).map_err(io(&under_way))?;
        }
        fs::create_dir_all(&under_way).map_err(io(&under_way))?;
        let made = Self { folder: folder.to_owned(), _lock: lock };
        let text = serde_json::to_vec_pretty(&whole).map_err(|e| Error::Format(e.to_string()))?;
        made.write(MANIFEST, &text)?;
        Ok(made)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of an episode, which may not exist yet.
    pub fn episode(&self, policy: &str, index: usize) -> PathBuf {
        self.folder.join(EPISODES).join(policy).join(format!("{index:06}"))
    }

    /// Jobs without a stored episode. With `retry_failed` also jobs whose policy failed.
    ///
    /// # Errors
    /// A stored episode that is damaged.
    pub fn missing(&self, manifest: &Manifest, retry_failed: bool) -> Result<Vec<Job>> {
        let mut missing = Vec::new();
        for job in manifest.jobs() {
            match self.read(&job)? {
                Some(record) if !(retry_failed && matches!(record.summary.end, Some(End::PolicyError { .. }))) => {}
                _ => missing.push(job),
            }
        }
        Ok(missing)
    }

    /// Stores a finished episode.
    ///
    /// # Errors
    /// Files that cannot be written, or that are not files of an episode.
    pub fn put(&self, job: &Job, files: &EpisodeFiles) -> Result<()> {
        let target = self.episode(&job.policy.name, job.index);
        let partial = self.folder.join(IN_PROGRESS).join(format!("{}-{:06}", job.policy.name, job.index));
        fs::create_dir_all(&partial).map_err(io(&partial))?;
        for (name, bytes) in &files.0 {
            if ![EPISODE_FILE, CHANNELS_FILE, RESULT_FILE, SURFACES_FILE].contains(&name.as_str()) {
                return Err(Error::Mismatch(format!("an episode has no file '{name:.60}'")));
            }
            let path = partial.join(name);
            let mut file = fs::File::create(&path).map_err(io(&path))?;
            std::io::Write::write_all(&mut file, bytes).map_err(io(&path))?;
            // The folder's final name means that it is complete, so its files are synced first.
            file.sync_all().map_err(io(&path))?;
        }
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(io(parent))?;
        }
        // An older episode is renamed as a whole: no part of it is ever visible. Names of policies
        // may have dots, so `with_extension` would not do.
        let aside = self.folder.join(IN_PROGRESS).join(format!("{}-{:06}.old", job.policy.name, job.index));
        if target.exists() {
            fs::rename(&target, &aside).map_err(io(&target))?;
            // The video shows the older episode; there may be none.
            let _ = fs::remove_file(self.folder.join(video_name(&job.policy.name, job.index)));
        }
        fs::rename(&partial, &target).map_err(io(&target))?;
        if aside.exists() {
            fs::remove_dir_all(&aside).map_err(io(&aside))?;
        }
        Ok(())
    }

    /// The stored episodes of the manifest, by policy and index.
    ///
    /// # Errors
    /// A stored episode that is damaged.
    pub fn records(&self, manifest: &Manifest) -> Result<Vec<EpisodeRecord>> {
        let mut all = Vec::new();
        for job in manifest.jobs() {
            all.extend(self.read(&job)?);
        }
        let place = |k: &EpisodeRecord| (manifest.policies.iter().position(|p| p.name == k.name), k.index);
        all.sort_by_key(place);
        Ok(all)
    }

    fn read(&self, job: &Job) -> Result<Option<EpisodeRecord>> {
        let path = self.episode(&job.policy.name, job.index).join(RESULT_FILE);
        let text = match fs::read(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            text => text.map_err(io(&path))?,
        };
        let damaged = |why: String| self.damaged(&job.policy.name, job.index, &format!("{RESULT_FILE}: {why}"));
        let mut record: EpisodeRecord = serde_json::from_slice(&text).map_err(|e| damaged(e.to_string()))?;
        if record.seed != job.seed {
            return Err(damaged(format!("its seed is {}, not {}", record.seed, job.seed)));
        }
        (record.name, record.index) = (job.policy.name.clone(), job.index);
        Ok(Some(record))
    }

    /// The error of an unusable episode, with the remedy.
    pub(super) fn damaged(&self, policy: &str, index: usize, why: &str) -> Error {
        let reason = format!("holds a damaged episode ({why}); remove it and it is run again");
        Error::Exists { path: self.episode(policy, index), reason }
    }

    /// The error of a file of an episode that cannot be read. Other errors pass unchanged.
    pub(super) fn read_error(&self, record: &EpisodeRecord, why: trocar_task::Error) -> Error {
        let file = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let why = match &why {
            trocar_task::Error::Invalid { path, reason } => format!("{}: {reason}", file(path)),
            trocar_task::Error::Io { path, source } if source.kind() == std::io::ErrorKind::NotFound => {
                format!("{} is missing", file(path))
            }
            _ => return why.into(),
        };
        self.damaged(&record.name, record.index, &why)
    }

    /// The error of the first of these episodes whose channels cannot be read.
    pub(super) fn unreadable_channels(&self, records: &[EpisodeRecord]) -> Option<Error> {
        records.iter().find_map(|k| {
            let read = read_channels(&self.episode(&k.name, k.index).join(CHANNELS_FILE));
            read.err().map(|why| self.read_error(k, why))
        })
    }

    /// Writes the file `name` of the campaign, whole or not at all.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let (path, partial) = (self.folder.join(name), self.folder.join(IN_PROGRESS).join(name));
        for parent in [path.parent(), partial.parent()].into_iter().flatten() {
            fs::create_dir_all(parent).map_err(io(parent))?;
        }
        fs::write(&partial, bytes).map_err(io(&partial))?;
        fs::rename(&partial, &path).map_err(io(&path))
    }
}

/// Writes a file whole or not at all, beside the campaigns of a folder that exists.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let partial = path.with_extension("part");
    fs::write(&partial, bytes).map_err(io(&partial))?;
    fs::rename(&partial, path).map_err(io(path))
}
