//! Output: one JSON object, or lines for people.

use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a result could not be printed.
static LOST: AtomicBool = AtomicBool::new(false);

/// Whether a result could not be printed; the program then ends with an error.
pub fn lost() -> bool {
    LOST.load(Ordering::Relaxed)
}

fn lose(why: impl std::fmt::Display) {
    eprintln!("error: {why}");
    LOST.store(true, Ordering::Relaxed);
}

/// Prints `value` as JSON, or as the text for people that `text` returns.
pub fn print<T: Serialize>(json: bool, value: &T, text: impl FnOnce(&T) -> String) {
    let line = if json {
        match serde_json::to_string(value) {
            Ok(line) => line,
            Err(e) => return lose(format_args!("the result cannot be written as JSON: {e}")),
        }
    } else {
        text(value)
    };
    self::line(&line);
}

/// Prints one or more lines.
pub fn line(text: &str) {
    match writeln!(std::io::stdout(), "{text}") {
        // A closed pipe means that the reader wants no more, which is no error.
        Err(e) if e.kind() != ErrorKind::BrokenPipe => lose(format_args!("standard output: {e}")),
        _ => {}
    }
}
