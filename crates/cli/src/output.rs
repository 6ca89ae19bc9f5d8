//! What is printed: one JSON object for machines, or lines for people.

use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Set once a result could not be handed over: the work was done, and nobody has it.
static LOST: AtomicBool = AtomicBool::new(false);

/// Whether a result could not be printed; the program then ends with an error.
pub fn lost() -> bool {
    LOST.load(Ordering::Relaxed)
}

fn lose(why: impl std::fmt::Display) {
    eprintln!("error: {why}");
    LOST.store(true, Ordering::Relaxed);
}

/// Prints `value` as JSON, or what `text` says for people.
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

/// Prints a line, or several.
pub fn line(text: &str) {
    match writeln!(std::io::stdout(), "{text}") {
        // Nobody reads on: that is theirs to decide.
        Err(e) if e.kind() != ErrorKind::BrokenPipe => lose(format_args!("standard output: {e}")),
        _ => {}
    }
}

/// Rows with aligned columns: the first left, the others right.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut widths: Vec<usize> = header.iter().map(|h| h.chars().count()).collect();
    for row in rows {
        for (w, cell) in widths.iter_mut().zip(row) {
            *w = (*w).max(cell.chars().count());
        }
    }
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut out = String::new();
        for (k, (cell, w)) in cells.zip(&widths).enumerate() {
            let pad = " ".repeat(w - cell.chars().count());
            out += &if k == 0 { format!("  {cell}{pad}") } else { format!("  {pad}{cell}") };
        }
        out
    };
    let mut lines = vec![line(&mut header.iter().copied())];
    lines.extend(rows.iter().map(|row| line(&mut row.iter().map(String::as_str))));
    lines.join("\n")
}
