//! The same bits on 64-bit ARM as on x86-64: the program is cross-compiled and run in an emulator.
//!
//! The golden tests of the solvers and of the cell run there, and a phantom is recorded and
//! reconstructed on both. The emulator is some twenty times slower than the machine.

use crate::cargo_program;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const TARGET: &str = "aarch64-unknown-linux-gnu";

/// The compiler's driver, which links.
const LINKER: &str = "aarch64-linux-gnu-gcc";

/// The emulator, as distributions call it.
const EMULATORS: [&str; 2] = ["qemu-aarch64", "qemu-aarch64-static"];

/// Where the linker's package has the system's libraries.
const LIBRARIES: &str = "/usr/aarch64-linux-gnu";

/// Crates that have golden tests.
const CRATES: [&str; 3] = ["trocar-tissue", "trocar-tissue-reference", "trocar-cell"];

/// Frames of the recording.
const FRAMES: &str = "31";

/// Where recording and specimen are written.
const FOLDER: &str = "target/aarch64";

/// Compares both machines; says so where that is not possible here.
///
/// # Errors
/// A program that could not be built, or another result.
pub fn check() -> Result<(), String> {
    let Some(emulator) = EMULATORS.into_iter().find(|name| starts(name)).filter(|_| starts(LINKER)) else {
        eprintln!("skipped: needs {LINKER} and {} (Debian: gcc-aarch64-linux-gnu, qemu-user)", EMULATORS[0]);
        return Ok(());
    };
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        eprintln!("skipped: compares with x86-64 Linux, which this is not");
        return Ok(());
    }
    run(Command::new("rustup").args(["target", "add", TARGET]))?;
    let emulated = format!("{emulator} -L {LIBRARIES}");
    let cross = |arguments: &[&str]| {
        let name = TARGET.replace('-', "_").to_uppercase();
        let variables =
            [(format!("CARGO_TARGET_{name}_LINKER"), LINKER), (format!("CARGO_TARGET_{name}_RUNNER"), &emulated)];
        run(Command::new(cargo_program())
            .args(arguments)
            .args(["--release", "--locked", "--target", TARGET])
            .envs(variables))
    };
    for name in CRATES {
        cross(&["test", "-p", name, "--test", "golden"])?;
    }
    cross(&["build", "-p", "trocar-cli"])?;
    run(Command::new(cargo_program()).args(["build", "--release", "--locked", "-p", "trocar-cli"]))?;
    let own = reconstructed("x86-64", || Command::new("target/release/trocar"))?;
    let other = reconstructed("aarch64", || {
        let mut program = Command::new(emulator);
        program.args(["-L", LIBRARIES]).arg(format!("target/{TARGET}/release/trocar"));
        program
    })?;
    let (found, expected) = (files(&other)?, files(&own)?);
    if found != expected {
        return Err(format!("{} has {} files, {} has {}", other.display(), found.len(), own.display(), expected.len()));
    }
    for file in &found {
        if read(&other.join(file))? != read(&own.join(file))? {
            return Err(format!("{} and {} differ", other.join(file).display(), own.join(file).display()));
        }
    }
    eprintln!(
        "\nthe golden hashes hold on aarch64; {} files of a recording and its specimen are the same",
        found.len()
    );
    Ok(())
}

/// Records and reconstructs a phantom with a program; returns the folder of both.
fn reconstructed(machine: &str, program: impl Fn() -> Command) -> Result<PathBuf, String> {
    let folder = Path::new(FOLDER).join(machine);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let [recording, specimen] = ["recording", "specimen"].map(|name| folder.join(name));
    run(program().args(["record", "phantom-a", "--frames", FRAMES, "--output"]).arg(&recording))?;
    run(program().arg("reconstruct").arg(&recording).arg("--output").arg(&specimen))?;
    Ok(folder)
}

/// The files in a folder and in those within it, by their paths from there, sorted.
fn files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = PathBuf::from(entry.file_name());
        if entry.path().is_dir() {
            found.extend(files(&entry.path())?.into_iter().map(|path| name.join(path)));
        } else {
            found.push(name);
        }
    }
    found.sort();
    Ok(found)
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))
}

/// Whether a program is there.
fn starts(name: &str) -> bool {
    let version = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    version.is_ok_and(|status| status.success())
}

fn run(command: &mut Command) -> Result<(), String> {
    eprintln!("\n== {}", format!("{command:?}").replace('"', ""));
    let status = command.status().map_err(|e| format!("{command:?}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?} failed")) }
}
