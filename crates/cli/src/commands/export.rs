//! `trocar export`: the Python package has the writers of datasets and does their work; a glTF file
//! is written here.

use crate::cli::{Export, Layout};
use crate::output;
use std::process::Command;
use trocar_campaign::interpreter;
use trocar_core::Progress;
use trocar_task::EPISODE_FILE;
use trocar_workflow::{Error, RecordedEpisode, Result, counted, write_gltf};

/// Exit status of an interruption, and of an error that was printed.
const INTERRUPTED: i32 = 130;
const SAID: i32 = 2;

pub fn run(arguments: &Export, json: bool, quiet: bool, progress: &dyn Progress) -> Result<()> {
    let layout = match arguments.format {
        Layout::Lerobot => "lerobot",
        Layout::Robomimic => "robomimic",
        Layout::Gltf => return gltf(arguments, json, progress),
    };
    let python = interpreter(None);
    check(&python)?;
    let mut command = Command::new(&python);
    command.args(["-m", "trocar.export"]).args(&arguments.sources).arg("--output").arg(&arguments.output);
    command.args(["--format", layout]).arg("--phantoms").arg(&arguments.phantoms);
    if let Some([width, height]) = arguments.size {
        command.args(["--size", &format!("{width}x{height}")]);
    }
    if let Some(specimen) = &arguments.specimen {
        command.arg("--specimen").arg(specimen);
    }
    let plain = (arguments.plain_light, "--plain-light");
    for (wanted, option) in [(arguments.all, "--all"), plain, (json, "--json"), (quiet, "--quiet")] {
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
        Some(SAID) => Err(Error::Mismatch("nothing was exported".to_owned())),
        _ => Err(Error::Mismatch(format!("{python} -m trocar.export ended with {status}"))),
    }
}

/// Writes one episode as a glTF file.
fn gltf(arguments: &Export, json: bool, progress: &dyn Progress) -> Result<()> {
    let [source] = &arguments.sources[..] else {
        let count = arguments.sources.len();
        return Err(Error::Mismatch(format!("a glTF file is of one episode; {count} sources were given")));
    };
    if !source.join(EPISODE_FILE).is_file() {
        return Err(Error::Mismatch(format!("{}: no episode folder: it has no {EPISODE_FILE}", source.display())));
    }
    let mut episode = RecordedEpisode::open(source, arguments.specimen.as_deref(), &arguments.phantoms, progress)?;
    let written = write_gltf(&mut episode, &arguments.output, arguments.keyframes, progress)?;
    output::print(json, &written, |w| {
        let note = episode.note.as_ref().map_or(String::new(), |note| format!("\n{note}"));
        let (moments, size) = (counted(w.keyframes, "keyframe"), 1e-6 * w.bytes as f64);
        format!("{}: {moments} over {:.1} s, {size:.1} MB{note}", arguments.output.display(), w.length_s)
    });
    Ok(())
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
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it gave no reason");
    Err(Error::Mismatch(format!("{python} cannot import trocar.export: {last}; {right}")))
}
