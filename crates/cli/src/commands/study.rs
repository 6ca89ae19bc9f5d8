//! `trocar experiment` and `trocar bench`.

use crate::cli::StudyChoice;
use crate::output;
use std::process::{Command, Stdio};
use trocar_core::Progress;
use trocar_studies::registry::STUDIES;
use trocar_studies::study::Kind;
use trocar_studies::{Error, Result, docs};

pub fn run(choice: &StudyChoice, kind: Kind, json: bool, progress: &dyn Progress) -> Result<()> {
    let Some(entry) = STUDIES.iter().find(|e| e.kind() == kind && e.name() == choice.name) else {
        return Err(Error::Mismatch(format!("there is no {} '{}'", kind.name(), choice.name)));
    };
    let printed = entry.run(&choice.options, progress)?;
    if let Some(path) = choice.options.get_one::<std::path::PathBuf>("docs") {
        let text = docs::page(*entry, &command(), &commit(), &printed.docs);
        std::fs::write(path, text).map_err(|source| Error::Io { path: path.clone(), source })?;
    }
    output::line(if json { &printed.json } else { printed.text.trim_end() });
    Ok(())
}

/// The typed command without options that do not change figures.
fn command() -> String {
    let mut words = vec!["trocar".to_owned()];
    let mut typed = std::env::args().skip(1);
    while let Some(word) = typed.next() {
        match word.as_str() {
            "--docs" | "-o" | "--output" | "--resume" | "--phantoms" => {
                typed.next();
            }
            "-q" | "--quiet" | "--json" => {}
            w if w.starts_with("--docs=") || w.starts_with("--output=") || w.starts_with("--phantoms=") => {}
            _ => words.push(word),
        }
    }
    words.join(" ")
}

/// The commit of the repository in which the program runs; with `+` if files are changed.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let run = Command::new("git").args(arguments).stderr(Stdio::null()).output().ok()?;
        run.status.success().then(|| String::from_utf8_lossy(&run.stdout).trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short", "HEAD"]) else { return "unknown".to_owned() };
    let changed =
        git(&["status", "--porcelain", "--untracked-files=no", "--", "crates"]).is_some_and(|s| !s.is_empty());
    if changed { commit + "+" } else { commit }
}
