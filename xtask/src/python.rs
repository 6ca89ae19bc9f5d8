//! The checks of the Python package: ruff, mypy and its tests, in a virtual environment below the
//! target folder. They are skipped, with the reason, where Python or the network is missing.
//!
//! The native module is built by cargo, not by maturin: `maturin develop` selects one package,
//! which turns off features of shared dependencies (memchr, ahash, rustix, simba and others) that
//! the tests of the workspace turn on, so everything above them would be compiled a second time.
//! Only where the module needs maturin's linker arguments does maturin build it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The virtual environment.
const ENVIRONMENT: &str = "target/python";
/// The oldest Python that the package supports, as `pyproject.toml` says.
const SUPPORTED: &str = "import sys; sys.exit(sys.version_info < (3, 10))";
/// Packages of the checks. Heavy ones (Ray, LeRobot, PyTorch) are not among them: their tests are
/// skipped, and mypy treats them as untyped.
const PACKAGES: [&str; 13] = [
    "maturin>=1.9,<2",
    "ruff==0.17.6",
    "mypy==2.4.1",
    "pytest>=8",
    "numpy>=1.26",
    "gymnasium>=1.1",
    "av>=14",
    "h5py>=3.10",
    "pandas>=2.2",
    "pyarrow>=17",
    "opencv-python-headless>=4.10",
    "msgpack>=1.0",
    "websockets>=15",
];
/// Their modules.
const MODULES: &str =
    "maturin, ruff, mypy, pytest, numpy, gymnasium, av, h5py, pandas, pyarrow, cv2, msgpack, websockets";
/// Folders of Python code.
const SOURCES: [&str; 2] = ["python", "examples/python"];

/// What cargo builds besides the module and the program.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Build {
    /// All units of `cargo test --workspace`. After the tests only the module itself is compiled.
    Workspace,
    /// Nothing else. On a clean target folder this is the cheaper one.
    Module,
}

impl Build {
    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Workspace => &["--workspace", "--tests"],
            Self::Module => &["-p", "trocar-cli", "-p", "trocar-python"],
        }
    }
}

/// Runs the checks. `Err` has the name of the first that failed.
pub fn check(build: Build) -> Result<(), &'static str> {
    eprintln!("\n== Python");
    let python = match environment() {
        Ok(python) => python,
        Err(reason) => {
            eprintln!("   skipped: {reason}");
            return Ok(());
        }
    };
    let (Ok(environment), Ok(source)) = (std::path::absolute(ENVIRONMENT), std::path::absolute("python")) else {
        return Err("the current folder");
    };
    let run = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).env("VIRTUAL_ENV", &environment).env("PYTHONPATH", &source).stdin(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    let on_sources = |words: &[&'static str]| run(&[words, &SOURCES].concat());
    let steps: [(&str, &dyn Fn() -> bool); 5] = [
        ("ruff format", &|| on_sources(&["-m", "ruff", "format", "--check", "--quiet"])),
        ("ruff check", &|| on_sources(&["-m", "ruff", "check", "--quiet"])),
        ("mypy", &|| run(&["-m", "mypy", "--no-error-summary"])),
        ("the native module", &|| build_module(build, &run)),
        ("pytest", &|| run(&["-m", "pytest", "-q", "python/tests"])),
    ];
    for (name, step) in steps {
        eprintln!("== Python: {name}");
        if !step() {
            return Err(name);
        }
    }
    Ok(())
}

/// Builds the native module and puts it into the package. Also builds the program, which some tests
/// start.
fn build_module(build: Build, run: &dyn Fn(&[&str]) -> bool) -> bool {
    let common = ["build", "--release", "--locked", "--lib", "--bins", "--features=trocar-python/extension-module"];
    if !crate::cargo(&[&common, build.arguments()].concat(), &[]) {
        return false;
    }
    if !cfg!(target_os = "linux") {
        return run(&["-m", "maturin", "develop", "--release", "--locked", "--skip-install"]);
    }
    let (built, module) = ("target/release/lib_native.so", "python/trocar/_native.abi3.so");
    // Removed first: a running interpreter keeps the old file.
    let copied = std::fs::remove_file(module).or_else(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Ok(()),
        _ => Err(e),
    });
    match copied.and_then(|()| std::fs::copy(built, module)) {
        Ok(_) => true,
        Err(e) => {
            eprintln!("{built} cannot be copied to {module}: {e}");
            false
        }
    }
}

/// The interpreter of the environment, which is created if it is missing. `Err` has the reason why
/// there is none.
fn environment() -> Result<PathBuf, String> {
    // Not in `Scripts` of Windows: continuous integration runs these checks on Linux.
    let python = Path::new(ENVIRONMENT).join("bin/python");
    let python = std::path::absolute(python).map_err(|e| e.to_string())?;
    let import = || quiet(Command::new(&python).args(["-c", &format!("import {MODULES}")]));
    if import() {
        return Ok(python);
    }
    if !quiet(Command::new("python3").args(["-c", SUPPORTED])) {
        return Err("python3 is missing or older than 3.10".to_owned());
    }
    eprintln!("   {} into {ENVIRONMENT}", PACKAGES.join(" "));
    if !quiet(Command::new("python3").args(["-m", "venv", ENVIRONMENT])) {
        return Err("python3 -m venv fails (is python3-venv installed?)".to_owned());
    }
    let install = ["-m", "pip", "install", "--quiet"];
    if !quiet(Command::new(&python).args(install).args(PACKAGES)) || !import() {
        return Err("pip cannot install the packages (is there a network?)".to_owned());
    }
    Ok(python)
}

/// Runs a command without its output. Returns whether it succeeded.
fn quiet(command: &mut Command) -> bool {
    let status = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|s| s.success())
}
