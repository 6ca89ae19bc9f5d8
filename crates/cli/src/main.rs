//! The command line: parses, calls, prints; no logic of its own.

#![allow(clippy::print_stderr, reason = "this is a command-line program")]

mod bar;
mod cli;
mod commands;
mod lines;
mod output;

use clap::Parser;
use std::process::ExitCode;

/// Exit code of bad input, as clap uses it for bad arguments.
const BAD_INPUT: u8 = 2;
/// Exit code of a run the user stopped (128 + SIGINT).
const INTERRUPTED: u8 = 130;
/// Exit code of work that was done and whose result could not be printed.
const NOT_PRINTED: u8 = 1;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    let progress = bar::Bar::new(cli.quiet);
    match commands::run(&cli, &progress) {
        Ok(()) if output::lost() => ExitCode::from(NOT_PRINTED),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if progress.was_interrupted() => {
            match error {
                // It says what is kept and how to go on.
                trocar_studies::Error::Work(trocar_workflow::Error::Stopped { .. }) => eprintln!("{error}"),
                trocar_studies::Error::Interrupted => eprintln!("interrupted; nothing half-written was left behind"),
                _ => eprintln!("interrupted; nothing half-written was left behind ({error})"),
            }
            ExitCode::from(INTERRUPTED)
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(BAD_INPUT)
        }
    }
}
