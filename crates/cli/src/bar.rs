//! Progress on standard error, as a bar or as plain lines, and Ctrl-C.

use crate::lines::Lines;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use trocar_core::Progress;

/// The display of the current stage.
enum Shown {
    Bar(ProgressBar),
    Lines(Lines),
}

/// Shows one bar per stage, or occasional lines if standard error is no terminal. Shows nothing if
/// quiet.
pub struct Bar {
    current: Mutex<Option<Shown>>,
    stop: Arc<AtomicBool>,
    quiet: bool,
}

impl Bar {
    /// Handles Ctrl-C and the request to terminate: long work stops at its next frame and cleans
    /// up.
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let handler = Arc::clone(&stop);
        // Without a handler, Ctrl-C ends the program without cleaning up.
        let _ = ctrlc::set_handler(move || handler.store(true, Ordering::Relaxed));
        Self { current: Mutex::new(None), stop, quiet }
    }

    /// True once the user pressed Ctrl-C.
    pub fn was_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn current(&self) -> std::sync::MutexGuard<'_, Option<Shown>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Bar {
    fn begin(&self, stage: &str, total: u64) {
        if self.quiet {
            return;
        }
        let style = ProgressStyle::with_template("{msg:>14} [{bar:40}] {pos}/{len}  {elapsed}, {eta} left");
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr())
            .with_message(stage.to_owned())
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
        let hidden = bar.is_hidden();
        *self.current() =
            Some(if hidden { Shown::Lines(Lines::begin(stage, total, Instant::now())) } else { Shown::Bar(bar) });
    }

    fn advance(&self, units: u64) {
        match self.current().as_mut() {
            Some(Shown::Bar(bar)) => bar.inc(units),
            Some(Shown::Lines(lines)) => {
                if let Some(line) = lines.advance(units, Instant::now()) {
                    eprintln!("{line}");
                }
            }
            None => {}
        }
    }

    fn end(&self) {
        if let Some(Shown::Bar(bar)) = self.current().take() {
            bar.finish_and_clear();
        }
    }

    fn interrupted(&self) -> bool {
        self.was_interrupted()
    }
}
