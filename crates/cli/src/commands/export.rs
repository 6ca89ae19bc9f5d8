//! `trocar export`: the Python package has the writers of datasets, so it does the work.

use crate::cli::{Export, Layout};
use std::process::Command;
use trocar_campaign::interpreter;
use trocar_workflow::{Error, Result};

/// Exit status of an interruption, and of an error that was printed.
const INTERRUPTED: i32 = 130;
const SAID: i32 = 2;

pub fn run(arguments: &Export, json: bool, quiet: bool) -> Result<()> {
    let python = interpreter(None);
    check(&python)?;
    let mut command = Command::new(&python);
    command.args(["-m", "trocar.export"]).args(&arguments.sources).arg("--output").arg(&arguments.output);
    let layout = match arguments.format {
        Layout::Lerobot => "lerobot",
        Layout::Robomimic => "robomimic",
    };
    command.args(["--format", layout]).arg("--phantoms").arg(&arguments.phantoms);
    if let Some([width, height]) = arguments.size {
        command.args(["--size", &format!("{width}x{height}")]);
    }
    if let Some(specimen) = &arguments.specimen {
        command.arg("--specimen").arg(specimen);
    }
    for (wanted, option) in [(arguments.all, "--all"), (json, "--json"), (quiet, "--quiet")] {
        if wanted {
            command.arg(option);
        }
    }
    if !arguments.cameras.is_empty() {
        let names = arguments.cameras.iter().filter(|name| *name != "none");
        command.arg("--cameras").args(names);
    }
    let status = command.status().map_err(|e| Error::Mismatch(format!("{python} cannot be started: {e}")))?;
    match status.code() {
        Some(0) => Ok(()),
        Some(INTERRUPTED) => Err(Error::Interrupted),
        Some(SAID) => Err(Error::Mismatch("nothing more was exported".to_owned())),
        _ => Err(Error::Mismatch(format!("{python} -m trocar.export ended with {status}"))),
    }
}

/// Checks that the interpreter has the package.
fn check(python: &str) -> Result<()> {
    let right = "run pip install '.[datasets]' with it, or name another interpreter in $TROCAR_PYTHON";
    let tried = Command::new(python).args(["-c", "import trocar.export"]).output();
    let tried = tried.map_err(|e| Error::Mismatch(format!("{python} cannot be started: {e}; {right}")))?;
    if tried.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&tried.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no reason is told");
    Err(Error::Mismatch(format!("{python} cannot import trocar.export: {last}; {right}")))
}
