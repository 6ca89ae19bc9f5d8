//! The figures of the docs: tables and plots of studies, pictures, and what policies learned.

mod learning;
mod pictures;
mod sheet;
mod tables;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where studies and pictures leave their files. What is finished there is used again.
const WORK: &str = "target/figures";
/// The name of everything in `learning.rs`.
const LEARNING: &str = "learning";

/// Makes the figures named, or all: tables by the names of their studies, pictures by the names of
/// their files, `pictures` for all of these, `learning` for the learned policies.
pub fn run(names: &[&str]) -> Result<(), String> {
    if !crate::cargo(&["build", "--release", "--locked", "-p", "trocar-cli"], &[]) {
        return Err("trocar cannot be built".to_owned());
    }
    let trocar = Trocar(absolute(Path::new("target/release/trocar"))?);
    let all = names.is_empty();
    let names = if all { tables::names()? } else { names.iter().map(|n| (*n).to_owned()).collect() };
    for name in names {
        match name.as_str() {
            LEARNING => learning::run(&trocar)?,
            "pictures" => pictures::all(&trocar)?,
            file if file.contains('.') => pictures::one(&trocar, file)?,
            study => tables::run(&trocar, study)?,
        }
    }
    if all {
        pictures::all(&trocar)?;
        learning::run(&trocar)?;
    }
    Ok(())
}

/// The program.
struct Trocar(PathBuf);

impl Trocar {
    /// Runs a command and shows its progress.
    fn run(&self, words: &[&str]) -> Result<(), String> {
        eprintln!("== trocar {}", words.join(" "));
        let status = Command::new(&self.0).args(words).stdin(Stdio::null()).stdout(Stdio::null()).status();
        if status.is_ok_and(|s| s.success()) { Ok(()) } else { Err(format!("trocar {} failed", words.join(" "))) }
    }

    /// What a command prints; nothing if it fails.
    fn output(&self, words: &[&str]) -> Option<String> {
        let run = Command::new(&self.0).args(words).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
        run.status.success().then(|| String::from_utf8_lossy(&run.stdout).into_owned())
    }
}

/// The path from the root of the file system.
fn absolute(path: &Path) -> Result<PathBuf, String> {
    std::path::absolute(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Reads a text.
fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Writes a text.
fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}
