//! The project's own commands. `cargo xtask test` is what continuous integration runs and what a contributor runs before
//! sending a change.

use std::process::{Command, ExitCode};

/// A check: its name, the arguments of cargo, environment variables.
type Check = (&'static str, &'static [&'static str], &'static [(&'static str, &'static str)]);

/// The checks in their order: cheap ones first. Everything is built in release mode, because the tests simulate.
const TEST: &[Check] = &[
    ("formatting", &["fmt", "--all", "--check"], &[]),
    ("lints", &["clippy", "--workspace", "--all-targets", "--release", "--locked", "--", "-D", "warnings"], &[]),
    ("tests", &["test", "--workspace", "--release", "--locked"], &[]),
    ("docs", &["doc", "--workspace", "--no-deps", "--release", "--locked"], &[("RUSTDOCFLAGS", "-D warnings")]),
];

#[allow(clippy::print_stderr, reason = "this is a command-line program")]
fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments != ["test"] {
        eprintln!("usage: cargo xtask test    formatting, lints, tests and docs, warnings as errors");
        return ExitCode::from(2);
    }
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    for (name, arguments, variables) in TEST {
        eprintln!("\n== {name}: cargo {}", arguments.join(" "));
        match Command::new(&cargo).args(*arguments).envs(variables.iter().copied()).status() {
            Ok(status) if status.success() => {}
            Ok(status) => {
                eprintln!("\n{name} failed ({status})");
                return ExitCode::FAILURE;
            }
            Err(e) => {
                eprintln!("\n{cargo} could not be started: {e}");
                return ExitCode::FAILURE;
            }
        }
    }
    eprintln!("\nformatting, lints, tests and docs are in order");
    ExitCode::SUCCESS
}
