//! A folder that appears complete or not at all.

use crate::error::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder that is written beside its target under a hidden name, and moved into place by
/// [`StagedFolder::commit`]. Dropped uncommitted, it removes itself and the parents it created.
#[derive(Debug)]
pub struct StagedFolder {
    target: PathBuf,
    stage: PathBuf,
    /// Parents of the target that did not exist, outermost first.
    created: Vec<PathBuf>,
    committed: bool,
}

impl StagedFolder {
    /// Stages `target`, which must not exist, be empty, or be an earlier folder of the same kind,
    /// with a file named `marker`. An earlier folder stays untouched until the commit.
    ///
    /// # Errors
    /// When `target` is something else, or its parent cannot be created or written to.
    pub fn create(target: &Path, marker: &str) -> Result<Self> {
        let target = match target.canonicalize() {
            Ok(existing) => existing,
            Err(_) => target.to_owned(),
        };
        let Some(name) = target.file_name().map(|n| n.to_string_lossy().into_owned()) else {
            return Err(invalid(&target, "it is not the name of a folder that can be written"));
        };
        if target.exists() && !target.is_dir() {
            return Err(invalid(&target, "a file of that name exists; choose a new folder"));
        }
        if target.is_dir() && !target.join(marker).is_file() && !is_empty(&target)? {
            return Err(invalid(
                &target,
                &format!("the folder exists and holds no {marker}, so it is not overwritten; choose a new folder"),
            ));
        }
        let parent = match target.parent() {
            Some(p) if !p.as_os_str().is_empty() => p.to_owned(),
            _ => PathBuf::from("."),
        };
        let mut created: Vec<PathBuf> =
            parent.ancestors().take_while(|p| !p.as_os_str().is_empty() && !p.exists()).map(Path::to_owned).collect();
        created.reverse();
        fs::create_dir_all(&parent).map_err(io(&parent))?;
        let base = format!(".{name}.partial-{}", std::process::id());
        let mut stage = parent.join(&base);
        // Two writers of one target in one process get different numbers.
        for n in 1.. {
            match fs::create_dir(&stage) {
                Ok(()) => break,
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => stage = parent.join(format!("{base}-{n}")),
                Err(e) => {
                    remove_empty(&created);
                    return Err(io(&parent)(e));
                }
            }
        }
        Ok(Self { target, stage, created, committed: false })
    }

    /// Checks whether `target` can be written, and leaves nothing behind; for a clear error before
    /// long work.
    ///
    /// # Errors
    /// Those of [`StagedFolder::create`].
    pub fn check(target: &Path, marker: &str) -> Result<()> {
        Self::create(target, marker).map(drop)
    }

    /// The folder to write into.
    pub fn path(&self) -> &Path {
        &self.stage
    }

    /// Moves the folder into place. An earlier folder is moved aside first and deleted last, so it
    /// survives a failure. Its entries whose names the new folder does not have (a user's notes,
    /// runs) are kept.
    ///
    /// # Errors
    /// When the system refuses to move.
    pub fn commit(mut self) -> Result<()> {
        if self.target.exists() {
            let aside = self.stage.with_extension("replaced");
            fs::rename(&self.target, &aside).map_err(io(&self.target))?;
            if let Err(e) = fs::rename(&self.stage, &self.target) {
                // Restores the earlier folder; the first failure is the one to report.
                let _ = fs::rename(&aside, &self.target);
                return Err(io(&self.target)(e));
            }
            self.committed = true;
            keep_foreign(&aside, &self.target)?;
            fs::remove_dir_all(&aside).map_err(io(&aside))?;
        } else {
            fs::rename(&self.stage, &self.target).map_err(io(&self.target))?;
            self.committed = true;
        }
        Ok(())
    }
}

impl Drop for StagedFolder {
    fn drop(&mut self) {
        if !self.committed {
            // A destructor cannot report errors; a folder that stays is hidden and named "partial".
            let _ = fs::remove_dir_all(&self.stage);
            remove_empty(&self.created);
        }
    }
}

/// Moves the entries of `old` that `new` does not have into `new`.
fn keep_foreign(old: &Path, new: &Path) -> Result<()> {
    for entry in fs::read_dir(old).map_err(io(old))? {
        let name = entry.map_err(io(old))?.file_name();
        let place = new.join(&name);
        if !place.exists() {
            fs::rename(old.join(&name), &place).map_err(io(&place))?;
        }
    }
    Ok(())
}

fn remove_empty(created: &[PathBuf]) {
    for parent in created.iter().rev() {
        // Fails for folders that are in use by now.
        let _ = fs::remove_dir(parent);
    }
}

fn is_empty(dir: &Path) -> Result<bool> {
    Ok(fs::read_dir(dir).map_err(io(dir))?.next().is_none())
}

fn io(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
    |source| Error::Io { path: path.to_owned(), source }
}

fn invalid(path: &Path, reason: &str) -> Error {
    Error::Invalid { path: path.to_owned(), reason: reason.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn appears_complete_or_not_at_all() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("a/b/out");
        let staged = StagedFolder::create(&target, "mark").unwrap();
        fs::write(staged.path().join("mark"), "1").unwrap();
        assert!(!target.exists());
        drop(staged);
        assert!(entries(root.path()).is_empty(), "a dropped folder and its parents are gone");

        for content in ["1", "2"] {
            let staged = StagedFolder::create(&target, "mark").unwrap();
            fs::write(staged.path().join("mark"), content).unwrap();
            staged.commit().unwrap();
            assert_eq!(fs::read_to_string(target.join("mark")).unwrap(), content);
            assert_eq!(entries(target.parent().unwrap()), ["out"]);
        }
    }

    #[test]
    fn refuses_other_folders() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("precious");
        fs::create_dir(&target).unwrap();
        assert!(StagedFolder::check(&target, "mark").is_ok(), "an empty folder may be used");
        fs::write(target.join("thesis.txt"), "x").unwrap();
        assert!(StagedFolder::check(&target, "mark").unwrap_err().to_string().contains("precious"));
        assert!(
            StagedFolder::check(&target.join("thesis.txt"), "mark").unwrap_err().to_string().contains("thesis.txt")
        );
        assert!(StagedFolder::check(&target.join("thesis.txt/out"), "mark").is_err());
        assert!(StagedFolder::check(Path::new("/"), "mark").is_err());
        assert_eq!(entries(root.path()), ["precious"]);
    }
}
