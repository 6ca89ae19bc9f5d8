//! Trials that outlive an interruption: each finished one is a line of a file in the experiment's
//! folder, and the next run takes it from there.
//!
//! The file, `trials.jsonl`, begins with a line that names the experiment and a hash of everything
//! the trials depend on: options, specimen, program. A trial's line is its key and its row, written
//! at once and flushed, so that a run may be killed at any instant: a line that was torn is
//! dropped, and its trial is run again. A file of other settings is put aside as
//! `trials.jsonl.old`, and everything starts anew. While a run uses the file it is locked.

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
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// The file in the experiment's folder.
const FILE: &str = "trials.jsonl";

/// No experiment writes as much (bytes); what is longer is not read.
const LONGEST: u64 = 256 << 20;

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

/// What was taken from an earlier run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Resumed {
    /// Trials that an earlier run had finished.
    pub trials: usize,
    /// Why trials of an earlier run were put aside, if there were any.
    pub put_aside: Option<String>,
}

/// What was taken from an earlier run, in sentences; `what` names the trials.
pub(crate) fn resumed(resumed: &Resumed, what: &str) -> Vec<String> {
    let earlier = (resumed.trials > 0).then(|| format!("{} {what} taken from an earlier run", resumed.trials));
    earlier.into_iter().chain(resumed.put_aside.clone()).collect()
}

/// Outcomes of trials in the items' order, and how many of them are an earlier run's.
#[derive(Debug)]
pub(crate) struct Outcomes<R> {
    pub rows: Vec<R>,
    pub resumed: Resumed,
}

/// The store of an experiment's finished trials.
#[derive(Debug)]
pub(crate) struct Trials {
    path: PathBuf,
    file: Mutex<File>,
    /// By key: the row as it was written.
    done: BTreeMap<String, serde_json::Value>,
    put_aside: Option<String>,
}

impl Trials {
    /// Opens the store of `experiment` in `folder`, which exists, or begins it. `settings` is
    /// whatever decides the trials' outcome besides their keys; the program does, too, and is
    /// added.
    ///
    /// # Errors
    /// A file that cannot be read or written, or that another run is using.
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
                    "{} trials of other settings, another specimen or another program were put aside as {FILE}.old; all start anew",
                    trials.len()
                ));
                std::fs::rename(&path, path.with_extension("jsonl.old")).map_err(io)?;
                file = claim(&path)?;
            }
            Found::TooLong => {
                let reason = format!("is longer than {} MiB, so it is no list of trials; move it away", LONGEST >> 20);
                return Err(Error::Exists { path, reason });
            }
        }
        // What is torn goes; what follows is written after the last whole line.
        file.set_len(length).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        if length == 0 {
            append(&mut file, &header).map_err(io)?;
        }
        Ok(Self { path, file: Mutex::new(file), done, put_aside })
    }

    /// Does `run` for every item that no earlier run has finished, several at once on `threads`
    /// threads (0: all there are). `key` names an item, each by another name. The outcomes do not
    /// depend on what was interrupted when: they are in the items' order, and numbers are kept to
    /// the bit.
    ///
    /// A row that does not come back as it was (one that holds an infinity, say) is not kept, and
    /// is made anew by every run.
    ///
    /// # Errors
    /// That of the first trial that failed, an interruption, a file that cannot be written, two
    /// items of one name.
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
            return Err(Error::Mismatch(format!("two trials are named '{}'; each needs a name of its own", pair[0])));
        }
        let earlier = |key: &String| self.done.get(key).and_then(|row| R::deserialize(row).ok());
        let mut rows: Vec<Option<R>> = keys.iter().map(earlier).collect();
        let missing: Vec<usize> = (0..items.len()).filter(|k| rows[*k].is_none()).collect();
        let finished = items.len() - missing.len();
        let made = side_by_side(stage, &missing, (finished, threads), progress, |k, progress| {
            let row = run(&items[*k], progress)?;
            self.keep(&keys[*k], &row)?;
            Ok(row)
        })?;
        for (k, row) in missing.into_iter().zip(made) {
            rows[k] = Some(row);
        }
        let resumed = Resumed { trials: finished, put_aside: self.put_aside.clone() };
        Ok(Outcomes { rows: rows.into_iter().flatten().collect(), resumed })
    }

    fn keep<R: Serialize + DeserializeOwned>(&self, trial: &str, row: &R) -> Result<()> {
        let format = |e: serde_json::Error| Error::Format(e.to_string());
        let row = serde_json::to_value(row).map_err(format)?;
        if R::deserialize(&row).is_err() {
            return Ok(());
        }
        // A trial that panicked did so outside of this.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let line = Line { trial: trial.to_owned(), row };
        append(&mut file, &line).map_err(|source| Error::Io { path: self.path.clone(), source })
    }
}

/// Opens the file, made if it is not there, for this run alone.
fn claim(path: &Path) -> Result<File> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
    match file.try_lock() {
        Err(std::fs::TryLockError::WouldBlock) => {
            let reason = "is in use by another run; wait for it or name another folder".to_owned();
            Err(Error::Exists { path: path.to_owned(), reason })
        }
        // A file system without locks is no reason not to run.
        _ => Ok(file),
    }
}

/// What a file holds.
enum Found {
    /// Nothing, or no whole header.
    Nothing,
    /// Whole lines up to `good` bytes.
    Trials { header: Header, trials: BTreeMap<String, serde_json::Value>, good: u64 },
    /// More than is read.
    TooLong,
}

fn read(file: &mut File) -> std::io::Result<Found> {
    let mut bytes = Vec::new();
    Read::by_ref(file).take(LONGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LONGEST {
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

/// Writes one line in one call, so that only a line that is being written can be torn.
fn append(file: &mut File, value: &impl Serialize) -> std::io::Result<()> {
    let mut line = serde_json::to_vec(value)?;
    line.push(b'\n');
    file.write_all(&line)?;
    file.flush()
}

/// What stands for the program: trials of one build say nothing of another's.
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
        // Values that decimal digits do not give exactly.
        let value = (item as f64 + 0.1).sqrt() * 1e-7;
        Row { item, value, note: item.is_multiple_of(2).then(|| "ein \"Satz\"\nmit Umbruch".to_owned()) }
    }

    /// Runs 12 trials; the outcome and how often a trial was run.
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
    fn an_interrupted_run_goes_on_where_it_stopped() {
        let unbroken: Vec<Row> = (0..12).map(row).collect();
        // Two trials run at once, so that one more may be finished than was asked for.
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
    fn a_torn_line_is_run_again_wherever_it_was_torn() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join(FILE);
        run(dir.path(), "a", &Silent).0.unwrap();
        let whole = std::fs::read(&file).unwrap();
        let lines = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count();
        for length in 0..whole.len() {
            // Every place in the first lines, and some in all the others.
            if length > 400 && !length.is_multiple_of(37) {
                continue;
            }
            std::fs::write(&file, &whole[..length]).unwrap();
            let (outcome, again) = run(dir.path(), "a", &Silent);
            assert_eq!(outcome.unwrap().rows, (0..12).map(row).collect::<Vec<_>>(), "torn after {length} bytes");
            assert_eq!(again, 12 - lines(&whole[..length]).saturating_sub(1));
        }
        std::fs::write(&file, [&whole[..], b"\xff{}\n{\"trial\":1}\n"].concat()).unwrap();
        assert_eq!(run(dir.path(), "a", &Silent).1, 0, "damage at the end costs nothing before it");
        assert_eq!(lines(&std::fs::read(&file).unwrap()), 13);
    }

    #[test]
    fn other_settings_start_anew_and_say_so() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(run(dir.path(), "a", &Silent).0.unwrap().resumed, Resumed::default());
        let (outcome, count) = run(dir.path(), "b", &Silent);
        let said = outcome.unwrap().resumed.put_aside.unwrap();
        assert!(count == 12 && said.contains("12 trials") && said.contains(".old"), "{said}");
        assert!(dir.path().join("trials.jsonl.old").is_file());
        assert_eq!(run(dir.path(), "b", &Silent).0.unwrap().resumed, Resumed { trials: 12, put_aside: None });
    }

    #[test]
    fn what_cannot_be_kept_is_run_again_and_two_of_a_name_or_a_folder_are_refused() {
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
