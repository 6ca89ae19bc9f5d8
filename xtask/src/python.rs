//! The tests of the Python package, in an environment of their own. Without Python or network they are skipped, and say so.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where packages are installed, beside what cargo builds.
const FOLDER: &str = "target/python";

/// What the tests need besides the package. Ray has no wheels for some interpreters, so it may be absent; its test is skipped then.
const PACKAGES: [&str; 11] = [
    "maturin>=1.9,<2",
    "pytest>=8",
    "numpy>=1.26",
    "gymnasium>=1.1",
    "av>=14",
    "h5py>=3.10",
    "pandas>=2.2",
    "pyarrow>=17",
    "opencv-python-headless>=4.10",
    "msgpack>=1.0",
    "websockets>=13",
];
const MODULES: &str = "maturin, pytest, numpy, gymnasium, av, h5py, pandas, pyarrow, cv2, msgpack, websockets";
const OPTIONAL: &str = "ray>=2.40";

/// Builds the package and runs its tests; false where one failed. A machine without Python is no failure.
pub fn test() -> bool {
    let Some(python) = environment() else {
        eprintln!("   skipped: Python 3.10 or newer with venv, and network the first time, are needed");
        return true;
    };
    let (Ok(folder), Ok(source)) = (std::path::absolute(FOLDER), std::path::absolute("python")) else { return false };
    // The program evaluates Python policies in one of the tests.
    if !crate::cargo(&["build", "--release", "--locked", "-p", "trocar-cli"], &[]) {
        return false;
    }
    let run = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).env("VIRTUAL_ENV", &folder).env("PYTHONPATH", &source).stdin(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    run(&["-m", "maturin", "develop", "--release", "--locked", "--skip-install"])
        && run(&["-m", "pytest", "-q", "python/tests"])
}

/// The interpreter of the environment, made if it is not there.
fn environment() -> Option<PathBuf> {
    let python = std::path::absolute(Path::new(FOLDER).join("bin/python")).ok()?;
    let quiet = |command: &mut Command| {
        let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|s| s.success())
    };
    let import = || quiet(Command::new(&python).args(["-c", &format!("import {MODULES}")]));
    if import() {
        return Some(python);
    }
    if !quiet(Command::new("python3").args(["-c", "import sys; sys.exit(sys.version_info < (3, 10))"])) {
        return None;
    }
    eprintln!("== tools: {} into {FOLDER}", PACKAGES.join(" "));
    let made = quiet(Command::new("python3").args(["-m", "venv", FOLDER]))
        && quiet(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES));
    if !made || !import() {
        return None;
    }
    if !quiet(Command::new(&python).args(["-m", "pip", "install", "--quiet", OPTIONAL])) {
        eprintln!("   Ray cannot be installed; its test is skipped");
    }
    Some(python)
}
