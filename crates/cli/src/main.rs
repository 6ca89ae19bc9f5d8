//! The command line. It parses arguments, calls the library and prints results.

#![allow(clippy::print_stderr, reason = "this is a command-line program")]

mod bar;
mod cli;
mod commands;
mod lines;
mod open;
mod output;

use clap::Parser;
use std::process::ExitCode;

/// Exit code of bad input, as clap uses it for bad arguments.
const BAD_INPUT: u8 = 2;
/// Exit code of an interrupted command (128 + SIGINT).
const INTERRUPTED: u8 = 130;
/// Exit code of a finished command whose result could not be printed.
const NOT_PRINTED: u8 = 1;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    let progress = bar::Bar::new(cli.quiet);
    match commands::run(&cli, &progress) {
        Ok(()) if output::lost() => ExitCode::from(NOT_PRINTED),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if progress.was_interrupted() => {
            match error {
                trocar_workflow::Error::Stopped { .. } => eprintln!("{error}"),
                trocar_workflow::Error::Interrupted => eprintln!("interrupted; no partial output was left"),
                _ => eprintln!("interrupted; no partial output was left ({error})"),
            }
            ExitCode::from(INTERRUPTED)
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(BAD_INPUT)
        }
    }
}
