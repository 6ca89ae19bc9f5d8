//! The project's own commands. `cargo xtask test` is what continuous integration runs and what a
//! contributor runs before sending a change.

#![allow(clippy::print_stderr, reason = "this is a command-line program")]

mod aarch64;
mod columns;
mod figures;
mod package;
mod peers;
mod python;
mod tools;
mod viewer;

use std::process::{Command, ExitCode};

/// A check: its name, the arguments of cargo, environment variables.
type Check = (&'static str, &'static [&'static str], &'static [(&'static str, &'static str)]);

/// The checks in their order: cheap ones first. Everything is built in release mode, because the
/// tests simulate.
const TEST: &[Check] = &[
    ("formatting", &["fmt", "--all", "--check"], &[]),
    ("lints", &["clippy", "--workspace", "--all-targets", "--release", "--locked", "--", "-D", "warnings"], &[]),
    ("tests", &["test", "--workspace", "--release", "--locked"], &[]),
];

/// The programs in `examples/rust`, which are built with the tests and run after them.
const EXAMPLES: [&str; 5] = ["gravity", "grasp_lift", "two_arms", "reconstruct", "score_policy"];

/// The API documentation; warnings are errors.
const API_DOCS: Check =
    ("docs", &["doc", "--workspace", "--no-deps", "--release", "--locked"], &[("RUSTDOCFLAGS", "-D warnings")]);

const USAGE: &str = "usage: cargo xtask test          formatting, lints, tests, examples, docs, Python and the page, warnings as errors
       cargo xtask python        ruff, mypy and the tests of the Python package alone (skipped without Python or network)
       cargo xtask viewer        the page of the live view: build, unit tests, tests in headless Chromium (skipped without Node)
       cargo xtask package       all crates into target/package, the page of the live view with them (needs Node)
       cargo xtask docs          the API documentation, and the book in target/book where mdbook is installed
       cargo xtask tools         fetch the programs and libraries that some tests compare with (test does this too)
       cargo xtask peers         our stepping beside Newton and MuJoCo on one mesh (peers from PyPI; scripts from ../shared/peers)
       cargo xtask figures [NAME...]  tables of studies, files in docs/pictures, 'pictures' or 'learning'; all by default (hours)
       cargo xtask aarch64       the same bits on 64-bit ARM, in an emulator (skipped without qemu and a cross-compiler)
       cargo xtask fuzz [CASES]  damaged files against every reader, a million cases by default";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["test"] => {
            tools::fetch();
            test()
        }
        ["python"] => code(check_python(python::Build::Module)),
        ["viewer"] => code(check_viewer(viewer::Tests::Browser)),
        ["package"] => code(told(&package::package())),
        ["docs"] => code(docs()),
        ["tools"] => {
            tools::fetch();
            ExitCode::SUCCESS
        }
        ["figures", names @ ..] if names.iter().all(|name| !name.starts_with('-')) => code(told(&figures::run(names))),
        ["aarch64"] => code(told(&aarch64::check())),
        ["peers"] => code(told(&peers::run())),
        ["fuzz"] => fuzz(1_000_000),
        ["fuzz", cases] => match cases.parse() {
            Ok(cases) => fuzz(cases),
            Err(_) => usage(),
        },
        _ => usage(),
    }
}

fn usage() -> ExitCode {
    eprintln!("{USAGE}");
    ExitCode::from(2)
}

/// The exit status of a program that succeeded or not.
fn code(passed: bool) -> ExitCode {
    if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Prints why something failed; says whether it succeeded.
fn told(result: &Result<(), String>) -> bool {
    if let Err(why) = result {
        eprintln!("{why}");
    }
    result.is_ok()
}

fn test() -> ExitCode {
    eprintln!("\n== lines of prose");
    let of_rust = || told(&columns::check()) && TEST.iter().all(check) && EXAMPLES.iter().all(example) && docs();
    if of_rust() && check_python(python::Build::Workspace) && check_viewer(viewer::Tests::Unit) {
        eprintln!("\nformatting, lints, tests, examples, docs, Python and the page are in order");
        return ExitCode::SUCCESS;
    }
    ExitCode::FAILURE
}

fn check((name, arguments, variables): &Check) -> bool {
    eprintln!("\n== {name}: cargo {}", arguments.join(" "));
    let passed = cargo(arguments, variables);
    if !passed {
        eprintln!("\n{name} failed");
    }
    passed
}

/// Runs one example as it was built with the tests: as part of the workspace, so that nothing is
/// compiled a second time with other features.
fn example(name: &&str) -> bool {
    let program = std::path::Path::new("target/release/examples").join(name);
    eprintln!("\n== example: {}", program.display());
    let passed = Command::new(&program).status().is_ok_and(|status| status.success());
    if !passed {
        eprintln!("\nexample {name} failed");
    }
    passed
}

/// The API documentation, and the book where mdbook is installed.
fn docs() -> bool {
    if !check(&API_DOCS) {
        return false;
    }
    eprintln!("\n== book: mdbook build");
    match Command::new("mdbook").arg("build").status() {
        Ok(status) => status.success(),
        Err(_) => {
            eprintln!("   skipped: mdbook is not installed (cargo install mdbook)");
            true
        }
    }
}

fn check_python(build: python::Build) -> bool {
    let checked = python::check(build);
    if let Err(name) = checked {
        eprintln!("\nPython: {name} failed");
    }
    checked.is_ok()
}

fn check_viewer(tests: viewer::Tests) -> bool {
    let checked = viewer::check(tests);
    if let Err(name) = checked {
        eprintln!("\nThe page: {name} failed");
    }
    checked.is_ok()
}

/// Runs the tests named `damage_never_panics` of all crates; each takes its share of the cases.
fn fuzz(cases: usize) -> ExitCode {
    /// Crates with such a test.
    const CRATES: [&str; 7] = [
        "trocar-camera",
        "trocar-geometry",
        "trocar-recording",
        "trocar-remote",
        "trocar-robot",
        "trocar-scene",
        "trocar-specimen",
    ];
    let share = cases.div_ceil(CRATES.len()).to_string();
    for name in CRATES {
        eprintln!("\n== {name}: {share} cases");
        let arguments = ["test", "--release", "--locked", "-p", name, "--tests", "damage_never_panics"];
        if !cargo(&arguments, &[("TROCAR_FUZZ_CASES", &share)]) {
            eprintln!("\n{name} failed");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// The cargo that runs this program.
fn cargo_program() -> String {
    std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned())
}

/// Runs cargo; says whether it went well.
fn cargo(arguments: &[&str], variables: &[(&str, &str)]) -> bool {
    let cargo = cargo_program();
    match Command::new(&cargo).args(arguments).envs(variables.iter().copied()).status() {
        Ok(status) => status.success(),
        Err(e) => {
            eprintln!("\n{cargo} could not be started: {e}");
            false
        }
    }
}
