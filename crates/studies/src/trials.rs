//! Finished trials on disk: an interrupted study resumes from them.
//!
//! The file `trials.jsonl` in the output folder begins with the name of the study and a hash of
//! everything that the trials depend on: options, specimen, program. Each finished trial is one
//! more line, its key and its row, flushed at once. The run can be killed at any time: an
//! incomplete line is dropped and its trial runs again. A file with another hash is renamed to
//! `trials.jsonl.old` and all trials run again. The file is locked while a run uses it.

use crate::side_by_side::side_by_side;
use crate::{Error, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use trocar_core::Progress;
use trocar_workflow::counted;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// The file in the output folder.
const FILE: &str = "trials.jsonl";

/// A longer file is not read (bytes).
const MAX_BYTES: u64 = 256 << 20;

/// The first line.
#[derive(Debug, Serialize, Deserialize, PartialEq, Eq)]
struct Header {
    experiment: String,
    settings: String,
}

/// A finished trial.
#[derive(Serialize, Deserialize)]
struct Line<R> {
    trial: String,
    row: R,
}

/// Trials of an earlier run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Resumed {
    /// Trials that were used again.
    pub trials: usize,
    /// Why trials of an earlier run were not used, if there were any.
    pub put_aside: Option<String>,
}

/// Sentences about an earlier run; `what` names one of the trials.
pub(crate) fn resumed(resumed: &Resumed, what: &str) -> Vec<String> {
    let earlier =
        (resumed.trials > 0).then(|| format!("Used again: {} of an earlier run", counted(resumed.trials, what)));
    earlier.into_iter().chain(resumed.put_aside.clone()).collect()
}

/// Rows in the order of the items.
#[derive(Debug)]
pub(crate) struct Outcomes<R> {
    pub rows: Vec<R>,
    pub resumed: Resumed,
}

/// The finished trials of a study.
#[derive(Debug)]
pub(crate) struct Trials {
    path: PathBuf,
    file: Mutex<File>,
    /// Rows by key.
    done: BTreeMap<String, serde_json::Value>,
    put_aside: Option<String>,
}

impl Trials {
    /// Opens the file of `study` in `folder`, which must exist. `settings` is everything that a row
    /// depends on besides its key; the program is added.
    pub fn open(folder: &Path, experiment: &str, settings: &str) -> Result<Self> {
        let settings = format!("{:016x}", xxh3_64(format!("{settings}\n{}", program()).as_bytes()));
        let header = Header { experiment: experiment.to_owned(), settings };
        let path = folder.join(FILE);
        let io = |source| Error::Io { path: path.clone(), source };
        let mut put_aside = None;
        let mut file = claim(&path)?;
        let (mut done, mut length) = (BTreeMap::new(), 0);
        match read(&mut file).map_err(io)? {
            Found::Nothing => {}
            Found::Trials { header: earlier, trials, good } if earlier == header => (done, length) = (trials, good),
            Found::Trials { trials, .. } => {
                put_aside = Some(format!(
                    "{} trials of another program, specimen or other options were renamed to {FILE}.old; all trials \
                     run again",
                    trials.len()
                ));
                std::fs::rename(&path, path.with_extension("jsonl.old")).map_err(io)?;
                file = claim(&path)?;
            }
            Found::TooLong => {
                let reason = format!("is longer than {} MiB and is not a file of trials; move it", MAX_BYTES >> 20);
                return Err(Error::Exists { path, reason });
            }
        }
        // Drops an incomplete last line.
        file.set_len(length).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        if length == 0 {
            append(&mut file, &header).map_err(io)?;
        }
        Ok(Self { path, file: Mutex::new(file), done, put_aside })
    }

    /// Calls `run` for every item without a finished row, on `threads` threads (0: all). `key`
    /// names an item uniquely. Rows are in the order of the items and the same to the bit, however
    /// often the study was interrupted.
    ///
    /// A row that cannot be read back, such as one with an infinity, is not stored; every run
    /// computes it again.
    pub fn run<T: Sync, R: Serialize + DeserializeOwned + Send>(
        &self,
        stage: &str,
        items: &[T],
        key: impl Fn(&T) -> String,
        threads: usize,
        progress: &dyn Progress,
        run: impl Fn(&T, &dyn Progress) -> Result<R> + Sync,
    ) -> Result<Outcomes<R>> {
        let keys: Vec<String> = items.iter().map(key).collect();
        let mut sorted: Vec<&String> = keys.iter().collect();
        sorted.sort_unstable();
        if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::Mismatch(format!("two trials are named '{}'; names must be unique", pair[0])));
        }
        let earlier = |key: &String| self.done.get(key).and_then(|row| R::deserialize(row).ok());
        let rows: Vec<Option<R>> = keys.iter().map(earlier).collect();
        let missing: Vec<usize> = (0..items.len()).filter(|k| rows[*k].is_none()).collect();
        let finished = items.len() - missing.len();
        let rows: Vec<Mutex<Option<R>>> = rows.into_iter().map(Mutex::new).collect();
        side_by_side(stage, missing.len(), (finished, threads), progress, &|k, progress| {
            let k = missing[k];
            let row = run(&items[k], progress)?;
            self.store(&keys[k], &row)?;
            *rows[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(row);
            Ok(())
        })?;
        let rows = rows.into_iter().filter_map(|row| row.into_inner().unwrap_or_else(PoisonError::into_inner));
        let resumed = Resumed { trials: finished, put_aside: self.put_aside.clone() };
        Ok(Outcomes { rows: rows.collect(), resumed })
    }

    fn store<R: Serialize + DeserializeOwned>(&self, trial: &str, row: &R) -> Result<()> {
        let format = |e: serde_json::Error| Error::Format(e.to_string());
        let row = serde_json::to_value(row).map_err(format)?;
        if R::deserialize(&row).is_err() {
            return Ok(());
        }
        // A panic cannot happen while the lock is held, so a poisoned lock is valid.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let line = Line { trial: trial.to_owned(), row };
        append(&mut file, &line).map_err(|source| Error::Io { path: self.path.clone(), source })
    }
}

/// Opens or creates the file and locks it.
fn claim(path: &Path) -> Result<File> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
    match file.try_lock() {
        Err(std::fs::TryLockError::WouldBlock) => {
            let reason = "is in use by another run; wait for it or choose another folder".to_owned();
            Err(Error::Exists { path: path.to_owned(), reason })
        }
        // Some file systems have no locks.
        _ => Ok(file),
    }
}

/// The content of a file.
enum Found {
    /// Empty, or without a complete header.
    Nothing,
    /// Complete lines up to byte `good`.
    Trials { header: Header, trials: BTreeMap<String, serde_json::Value>, good: u64 },
    /// Longer than [`MAX_BYTES`].
    TooLong,
}

fn read(file: &mut File) -> std::io::Result<Found> {
    let mut bytes = Vec::new();
    Read::by_ref(file).take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Ok(Found::TooLong);
    }
    let mut lines = bytes.split_inclusive(|b| *b == b'\n').filter(|line| line.ends_with(b"\n"));
    let Some((first, header)) = lines.next().and_then(|line| Some((line, serde_json::from_slice(line).ok()?))) else {
        return Ok(Found::Nothing);
    };
    let (mut trials, mut good) = (BTreeMap::new(), first.len() as u64);
    for line in lines {
        let Ok(Line { trial, row }) = serde_json::from_slice(line) else { break };
        trials.insert(trial, row);
        good += line.len() as u64;
    }
    Ok(Found::Trials { header, trials, good })
}

/// Writes a line in one call: only the last line can be incomplete.
fn append(file: &mut File, value: &impl Serialize) -> std::io::Result<()> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    file.write_all(&line)?;
    file.flush()
}

/// Identifies the program: trials of another build are not used.
fn program() -> &'static str {
    static PROGRAM: OnceLock<String> = OnceLock::new();
    let hash = || -> Option<u64> {
        let mut file = File::open(std::env::current_exe().ok()?).ok()?;
        let (mut hasher, mut buffer) = (Xxh3::new(), vec![0; 1 << 20]);
        loop {
            match file.read(&mut buffer).ok()? {
                0 => return Some(hasher.digest()),
                n => hasher.update(&buffer[..n]),
            }
        }
    };
    PROGRAM.get_or_init(|| format!("{} {:016x}", env!("CARGO_PKG_VERSION"), hash().unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use trocar_core::{Silent, StopAfter};

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    struct Row {
        item: usize,
        value: f64,
        note: Option<String>,
    }

    fn row(item: usize) -> Row {
        // Values without an exact decimal form.
        let value = (item as f64 + 0.1).sqrt() * 1e-7;
        Row { item, value, note: item.is_multiple_of(2).then(|| "ein \"Satz\"\nmit Umbruch".to_owned()) }
    }

    /// Runs 12 trials. Returns the outcome, and how many trials ran.
    fn run(folder: &Path, settings: &str, progress: &dyn Progress) -> (Result<Outcomes<Row>>, usize) {
        let items: Vec<usize> = (0..12).collect();
        let count = AtomicUsize::new(0);
        let trials = Trials::open(folder, "test", settings).unwrap();
        let outcome = trials.run(
            "trials",
            &items,
            |k| format!("trial {k}"),
            2,
            progress,
            |k, _| {
                count.fetch_add(1, Ordering::SeqCst);
                Ok(row(*k))
            },
        );
        (outcome, count.into_inner())
    }

    #[test]
    fn an_interrupted_run_resumes() {
        let unbroken: Vec<Row> = (0..12).map(row).collect();
        // Two trials run in parallel: one more may finish than was asked for.
        for stop in [0, 1, 5, 9] {
            let dir = tempfile::tempdir().unwrap();
            let (outcome, first) = run(dir.path(), "a", &StopAfter::new(stop as u64));
            assert!(matches!(outcome, Err(Error::Interrupted)) && first >= stop && first < 12, "{stop}: {first}");
            let (outcome, second) = run(dir.path(), "a", &Silent);
            let outcome = outcome.unwrap();
            assert_eq!(outcome.rows, unbroken);
            assert_eq!((outcome.resumed.trials, first + second), (first, 12), "none lost, none repeated");
            let (outcome, third) = run(dir.path(), "a", &Silent);
            assert_eq!((outcome.unwrap().rows, third), (unbroken.clone(), 0));
        }
    }

    #[test]
    fn an_incomplete_line_runs_again() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join(FILE);
        run(dir.path(), "a", &Silent).0.unwrap();
        let whole = std::fs::read(&file).unwrap();
        let lines = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count();
        for length in 0..whole.len() {
            // Every byte of the first lines, and some of the others.
            if length > 400 && !length.is_multiple_of(37) {
                continue;
            }
            std::fs::write(&file, &whole[..length]).unwrap();
            let (outcome, again) = run(dir.path(), "a", &Silent);
            assert_eq!(outcome.unwrap().rows, (0..12).map(row).collect::<Vec<_>>(), "cut after {length} bytes");
            assert_eq!(again, 12 - lines(&whole[..length]).saturating_sub(1));
        }
        std::fs::write(&file, [&whole[..], b"\xff{}\n{\"trial\":1}\n"].concat()).unwrap();
        assert_eq!(run(dir.path(), "a", &Silent).1, 0, "damage at the end costs nothing before it");
        assert_eq!(lines(&std::fs::read(&file).unwrap()), 13);
    }

    #[test]
    fn other_settings_run_all_trials_again() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(run(dir.path(), "a", &Silent).0.unwrap().resumed, Resumed::default());
        let (outcome, count) = run(dir.path(), "b", &Silent);
        let said = outcome.unwrap().resumed.put_aside.unwrap();
        assert!(count == 12 && said.contains("12 trials") && said.contains(".old"), "{said}");
        assert!(dir.path().join("trials.jsonl.old").is_file());
        assert_eq!(run(dir.path(), "b", &Silent).0.unwrap().resumed, Resumed { trials: 12, put_aside: None });
    }

    #[test]
    fn unreadable_rows_run_again_and_equal_names_and_shared_folders_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let trials = Trials::open(dir.path(), "test", "").unwrap();
        let key = |k: &f64| k.to_string();
        let outcome = trials.run("", &[1.0, f64::NAN], key, 1, &Silent, |k, _| Ok(*k)).unwrap();
        assert!(outcome.rows[0] == 1.0 && outcome.rows[1].is_nan());
        let refused = trials.run("", &[1.0, 1.0], key, 1, &Silent, |k, _| Ok(*k)).unwrap_err().to_string();
        assert!(refused.contains("two trials are named '1'"), "{refused}");
        let busy = Trials::open(dir.path(), "test", "").unwrap_err().to_string();
        assert!(busy.contains("in use") && busy.contains(FILE), "{busy}");
        drop(trials);
        let trials = Trials::open(dir.path(), "test", "").unwrap();
        let again = trials.run("", &[1.0, f64::NAN], key, 1, &Silent, |_, _| Ok(2.0)).unwrap();
        assert_eq!((again.rows, again.resumed.trials), (vec![1.0, 2.0], 1));
    }
}
