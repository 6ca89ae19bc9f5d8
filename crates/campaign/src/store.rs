//! Finished episodes on disk: each in a folder of its own that appears whole or not at all.

use crate::plan::{self, Job, Plan};
use crate::source::PolicySpec;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use trocar_task::{ArmSummary, CHANNELS_FILE, EPISODE_FILE, End, RESULT_FILE, Recording, Summary, read_channels};
use trocar_workflow::{Error, Result};

/// What makes a folder a campaign's.
const PLAN: &str = "campaign.json";
/// Where the episodes are, and where they are written.
const EPISODES: &str = "episodes";
const UNDER_WAY: &str = "under-way";
/// What one process at a time holds.
const LOCK: &str = ".lock";

/// An episode's files by their names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Files(pub Vec<(String, Vec<u8>)>);

impl Files {
    /// Those of a finished episode.
    ///
    /// # Errors
    /// A folder for the time being that cannot be written.
    pub fn of(recording: &Recording) -> Result<Self> {
        let io = |source| Error::Io { path: std::env::temp_dir(), source };
        let folder = tempfile::tempdir().map_err(io)?;
        recording.write_into(folder.path())?;
        let names = [EPISODE_FILE, CHANNELS_FILE, RESULT_FILE];
        let read = |name: &str| {
            let path = folder.path().join(name);
            fs::read(&path).map(|bytes| (name.to_owned(), bytes)).map_err(|source| Error::Io { path, source })
        };
        Ok(Self(names.into_iter().map(read).collect::<Result<_>>()?))
    }
}

/// A kept episode, in figures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// Its policy's name.
    #[serde(default)]
    pub name: String,
    /// Its place among the policy's episodes.
    #[serde(default)]
    pub index: usize,
    /// The seed.
    pub seed: u64,
    /// Hash of the final state.
    pub state_hash: String,
    /// The figures.
    #[serde(flatten)]
    pub summary: Summary,
}

impl Kept {
    /// Median RCM deviation under load of the arm that was longest under load [mm]; None where none was.
    pub fn loaded_rcm_mm(&self) -> Option<f64> {
        let arms = self.summary.arms.iter().filter(|a| a.loaded_s > 0.0);
        arms.max_by(|a, b| a.loaded_s.total_cmp(&b.loaded_s)).map(|a| a.rcm_median_mm)
    }

    /// Delay of the measured tip behind the commanded one [ms], of the arm that was farthest off its command without load: one that stands still has none. None where neither was off.
    pub fn lag_ms(&self) -> Option<f64> {
        let arms = self.summary.arms.iter().filter(|a| a.tracking_rms_mm > 0.0);
        arms.max_by(|a, b| a.tracking_rms_mm.total_cmp(&b.tracking_rms_mm)).map(|a| a.lag_ms)
    }

    /// The larger of both arms of what `of` says.
    pub(crate) fn peak(&self, of: fn(&ArmSummary) -> f64) -> f64 {
        self.summary.arms.iter().map(of).fold(0.0, f64::max)
    }
}

/// A campaign's folder.
pub struct Store {
    folder: PathBuf,
    /// One process at a time writes; it is held as long as the store lives.
    _lock: fs::File,
}

/// Name of the moving picture of an episode in the campaign's folder.
pub(super) fn film_name(policy: &str, index: usize) -> String {
    format!("pictures/{policy}-{index:06}.webp")
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
    |source| Error::Io { path: path.to_owned(), source }
}

/// The plan of the campaign in `folder`; None where none was begun.
///
/// # Errors
/// A folder of something else, a plan that is damaged or cannot be read.
fn begun(folder: &Path) -> Result<Option<Plan>> {
    let path = folder.join(PLAN);
    let exists = |reason: String| Error::Exists { path: folder.to_owned(), reason };
    match fs::read(&path) {
        Ok(text) => {
            let plan = serde_json::from_slice(&text).map_err(|e| exists(format!("holds a damaged {PLAN}: {e}")))?;
            return Ok(Some(plan));
        }
        // Only what is not there is missing; what cannot be read is said to be so.
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(io(&path)(e)),
        Err(_) => {}
    }
    if folder.is_dir() {
        // A campaign that was killed before it had its plan has these, and nothing in them.
        let own = |name: &std::ffi::OsStr| [EPISODES, UNDER_WAY, LOCK].iter().any(|own| name == *own);
        for entry in fs::read_dir(folder).map_err(io(folder))? {
            if !own(&entry.map_err(io(folder))?.file_name()) {
                return Err(exists(format!("is not empty and is no campaign ({PLAN} is missing); name a new folder")));
            }
        }
    }
    Ok(None)
}

/// Whether a campaign of `policies` from `seed` on can be in `folder`, as far as that can be said without its specimen.
///
/// # Errors
/// As [`Store::open`].
pub(super) fn look(folder: &Path, policies: &[PolicySpec], seed: u64) -> Result<()> {
    let Some(old) = begun(folder)? else { return Ok(()) };
    let exists = |reason: String| Err(Error::Exists { path: folder.to_owned(), reason });
    let other = [("seed", old.seed != seed), ("program", old.program != plan::program())];
    if let Some((what, _)) = other.iter().find(|(_, differs)| *differs) {
        return exists(format!("is a campaign of another {what}; write into another folder"));
    }
    let changed = |p: &&PolicySpec| old.policies.iter().any(|o| o.name == p.name && !p.is(o));
    if let Some(policy) = policies.iter().find(changed) {
        return exists(format!("has episodes of another policy named '{}'; name this one differently", policy.name));
    }
    Ok(())
}

/// Whether `folder` has `count` episodes of the policy `name`, whatever they are of.
pub(super) fn has_episodes(folder: &Path, name: &str, count: usize) -> bool {
    let episodes = folder.join(EPISODES).join(name);
    (0..count).all(|index| episodes.join(format!("{index:06}")).join(RESULT_FILE).is_file())
}

impl Store {
    /// Opens the campaign in `folder` to go on with, or begins it. It may get more episodes and other policies, but not another scene, specimen or seed.
    ///
    /// # Errors
    /// A folder of something else or of another campaign; one that another process writes.
    pub fn open(folder: &Path, plan: &Plan) -> Result<Self> {
        let exists = |reason: String| Error::Exists { path: folder.to_owned(), reason };
        // Nothing is made in a folder of something else.
        begun(folder)?;
        let episodes = folder.join(EPISODES);
        fs::create_dir_all(&episodes).map_err(io(&episodes))?;
        let lock_path = folder.join(LOCK);
        let lock = fs::File::create(&lock_path).map_err(io(&lock_path))?;
        if lock.try_lock().is_err() {
            return Err(exists("is being written by another process".to_owned()));
        }
        // What another process has made of it is known only now.
        let mut whole = plan.clone();
        whole.policies = plan.policies.iter().map(PolicySpec::stored).collect();
        if let Some(old) = begun(folder)? {
            let other =
                [("scene", old.scene_hash != plan.scene_hash), ("specimen", old.specimen_hash != plan.specimen_hash)];
            if let Some((what, _)) = other.iter().find(|(_, differs)| *differs) {
                return Err(exists(format!("is a campaign of another {what}; write into another folder")));
            }
            look(folder, &plan.policies, plan.seed)?;
            // Episodes of policies that are not asked for now stay theirs.
            let others = old.policies.into_iter().filter(|o| plan.policies.iter().all(|p| p.name != o.name));
            whole.policies.extend(others);
        }
        let under_way = folder.join(UNDER_WAY);
        if under_way.exists() {
            fs::remove_dir_all(&under_way).map_err(io(&under_way))?;
        }
        fs::create_dir_all(&under_way).map_err(io(&under_way))?;
        let made = Self { folder: folder.to_owned(), _lock: lock };
        let text = serde_json::to_vec_pretty(&whole).map_err(|e| Error::Format(e.to_string()))?;
        made.write(PLAN, &text)?;
        Ok(made)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder of an episode, whether it is there or not.
    pub fn episode(&self, policy: &str, index: usize) -> PathBuf {
        self.folder.join(EPISODES).join(policy).join(format!("{index:06}"))
    }

    /// Jobs that are not done. With `retry_failed` also those whose policy failed.
    ///
    /// # Errors
    /// A kept episode that is damaged.
    pub fn missing(&self, plan: &Plan, retry_failed: bool) -> Result<Vec<Job>> {
        let mut missing = Vec::new();
        for job in plan.jobs() {
            match self.read(&job)? {
                Some(kept) if !(retry_failed && matches!(kept.summary.end, Some(End::PolicyError { .. }))) => {}
                _ => missing.push(job),
            }
        }
        Ok(missing)
    }

    /// Keeps a finished episode.
    ///
    /// # Errors
    /// Files that cannot be written, or with names that are no names.
    pub fn put(&self, job: &Job, files: &Files) -> Result<()> {
        let target = self.episode(&job.policy.name, job.index);
        let partial = self.folder.join(UNDER_WAY).join(format!("{}-{:06}", job.policy.name, job.index));
        fs::create_dir_all(&partial).map_err(io(&partial))?;
        for (name, bytes) in &files.0 {
            if ![EPISODE_FILE, CHANNELS_FILE, RESULT_FILE].contains(&name.as_str()) {
                return Err(Error::Mismatch(format!("an episode has no file '{name:.60}'")));
            }
            let path = partial.join(name);
            let mut file = fs::File::create(&path).map_err(io(&path))?;
            std::io::Write::write_all(&mut file, bytes).map_err(io(&path))?;
            // The folder's name says that all is there; so it must be there before the name is.
            file.sync_all().map_err(io(&path))?;
        }
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(io(parent))?;
        }
        // An episode that is done again goes aside whole, so that at no moment a part of it is there. The name is made whole: a policy's may have dots, and what follows the last is no extension.
        let aside = self.folder.join(UNDER_WAY).join(format!("{}-{:06}.old", job.policy.name, job.index));
        if target.exists() {
            fs::rename(&target, &aside).map_err(io(&target))?;
            // What was filmed is of the episode before; that there is no film is no error.
            let _ = fs::remove_file(self.folder.join(film_name(&job.policy.name, job.index)));
        }
        fs::rename(&partial, &target).map_err(io(&target))?;
        if aside.exists() {
            fs::remove_dir_all(&aside).map_err(io(&aside))?;
        }
        Ok(())
    }

    /// The kept episodes of the plan, policy after policy.
    ///
    /// # Errors
    /// A kept episode that is damaged, or missing.
    pub fn kept(&self, plan: &Plan) -> Result<Vec<Kept>> {
        let mut all = Vec::new();
        for job in plan.jobs() {
            all.extend(self.read(&job)?);
        }
        let place = |k: &Kept| (plan.policies.iter().position(|p| p.name == k.name), k.index);
        all.sort_by_key(place);
        Ok(all)
    }

    fn read(&self, job: &Job) -> Result<Option<Kept>> {
        let path = self.episode(&job.policy.name, job.index).join(RESULT_FILE);
        let text = match fs::read(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            text => text.map_err(io(&path))?,
        };
        let damaged = |why: String| self.damaged(&job.policy.name, job.index, &format!("{RESULT_FILE}: {why}"));
        let mut kept: Kept = serde_json::from_slice(&text).map_err(|e| damaged(e.to_string()))?;
        if kept.seed != job.seed {
            return Err(damaged(format!("its seed is {}, not {}", kept.seed, job.seed)));
        }
        (kept.name, kept.index) = (job.policy.name.clone(), job.index);
        Ok(Some(kept))
    }

    /// That an episode cannot be used, and what is to be done about it.
    pub(super) fn damaged(&self, policy: &str, index: usize, why: &str) -> Error {
        let reason = format!("holds a damaged episode ({why}); remove it to have it run again");
        Error::Exists { path: self.episode(policy, index), reason }
    }

    /// The same of an error of reading one of its files; other errors stay what they are.
    pub(super) fn unread(&self, kept: &Kept, why: trocar_task::Error) -> Error {
        let file = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let why = match &why {
            trocar_task::Error::Invalid { path, reason } => format!("{}: {reason}", file(path)),
            trocar_task::Error::Io { path, source } if source.kind() == std::io::ErrorKind::NotFound => {
                format!("{} is missing", file(path))
            }
            _ => return why.into(),
        };
        self.damaged(&kept.name, kept.index, &why)
    }

    /// The first of these episodes whose channels cannot be read, as what is said of it.
    pub(super) fn unreadable_channels(&self, kept: &[Kept]) -> Option<Error> {
        kept.iter().find_map(|k| {
            let read = read_channels(&self.episode(&k.name, k.index).join(CHANNELS_FILE));
            read.err().map(|why| self.unread(k, why))
        })
    }

    /// Writes a file of the campaign, whole or not at all.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let (path, partial) = (self.folder.join(name), self.folder.join(UNDER_WAY).join(name));
        for parent in [path.parent(), partial.parent()].into_iter().flatten() {
            fs::create_dir_all(parent).map_err(io(parent))?;
        }
        fs::write(&partial, bytes).map_err(io(&partial))?;
        fs::rename(&partial, &path).map_err(io(&path))
    }
}
