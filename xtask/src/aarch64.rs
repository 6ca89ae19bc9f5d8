//! The same bits on 64-bit ARM as on x86-64: the program is cross-compiled and run in an emulator.
//!
//! The golden tests of the solvers run there, and a short demonstration runs on both: recording,
//! reconstruction and episode. The emulator is some twenty times slower than the machine.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

const TARGET: &str = "aarch64-unknown-linux-gnu";

/// The compiler's driver, which links.
const LINKER: &str = "aarch64-linux-gnu-gcc";

/// The emulator, as distributions call it.
const EMULATORS: [&str; 2] = ["qemu-aarch64", "qemu-aarch64-static"];

/// Where the linker's package has the system's libraries.
const LIBRARIES: &str = "/usr/aarch64-linux-gnu";

/// Crates that have golden tests.
const CRATES: [&str; 2] = ["trocar-tissue", "trocar-tissue-reference"];

/// Frames of the demonstration's recording.
const FRAMES: &str = "31";

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
        run(Command::new(cargo()).args(arguments).args(["--release", "--locked", "--target", TARGET]).envs(variables))
    };
    for name in CRATES {
        cross(&["test", "-p", name, "--test", "golden"])?;
    }
    cross(&["build", "-p", "trocar-cli"])?;
    run(Command::new(cargo()).args(["build", "--release", "--locked", "-p", "trocar-cli"]))?;
    let own = demonstration(&mut Command::new("target/release/trocar"), "x86-64")?;
    let mut program = Command::new(emulator);
    program.args(["-L", LIBRARIES]).arg(format!("target/{TARGET}/release/trocar"));
    let other = demonstration(&mut program, "aarch64")?;
    if own != other {
        return Err(format!("the demonstration ends in state {own} on x86-64, in {other} on aarch64"));
    }
    eprintln!("\nthe golden hashes hold on aarch64, and the demonstration ends in state {own} on both");
    Ok(())
}

/// Runs the demonstration; returns the hash of its last state.
fn demonstration(program: &mut Command, machine: &str) -> Result<String, String> {
    eprintln!("\n== demonstration on {machine}");
    let folder = Path::new("target/demonstration").join(machine);
    let output = program
        .args(["demo", "--json", "--no-open", "--frames", FRAMES, "--output"])
        .arg(&folder)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| format!("{machine}: {e}"))?;
    let result: Value = serde_json::from_slice(&output.stdout).map_err(|e| format!("demo on {machine}: {e}"))?;
    let state = result["state"].as_str().ok_or_else(|| format!("demo on {machine} gives no state"))?;
    Ok(state.to_owned())
}

/// Whether a program is there.
fn starts(name: &str) -> bool {
    let version = Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    version.is_ok_and(|status| status.success())
}

fn cargo() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

fn run(command: &mut Command) -> Result<(), String> {
    eprintln!("\n== {}", format!("{command:?}").replace('"', ""));
    let status = command.status().map_err(|e| format!("{command:?}: {e}"))?;
    if status.success() { Ok(()) } else { Err(format!("{command:?} failed")) }
}
