//! Progress bars on standard error, and Ctrl-C.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use trocar_progress::Progress;

/// Shows one bar a stage; hidden when standard error is no terminal, or on request.
pub struct Bar {
    current: Mutex<Option<ProgressBar>>,
    stop: Arc<AtomicBool>,
    quiet: bool,
}

impl Bar {
    /// Takes over Ctrl-C (and the request to terminate): long work then stops at its next frame and cleans up.
    pub fn new(quiet: bool) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let handler = Arc::clone(&stop);
        // Without a handler Ctrl-C still ends the program, only less tidily.
        let _ = ctrlc::set_handler(move || handler.store(true, Ordering::Relaxed));
        Self { current: Mutex::new(None), stop, quiet }
    }

    /// True once the user pressed Ctrl-C.
    pub fn was_interrupted(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn current(&self) -> std::sync::MutexGuard<'_, Option<ProgressBar>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Bar {
    fn begin(&self, stage: &str, total: u64) {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let style = ProgressStyle::with_template("{msg:>14} [{bar:40}] {pos}/{len}  {elapsed} of {duration}");
        let bar = ProgressBar::with_draw_target(Some(total), target)
            .with_message(stage.to_owned())
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
        *self.current() = Some(bar);
    }

    fn advance(&self, units: u64) {
        if let Some(bar) = self.current().as_ref() {
            bar.inc(units);
        }
    }

    fn end(&self) {
        if let Some(bar) = self.current().take() {
            bar.finish_and_clear();
        }
    }

    fn interrupted(&self) -> bool {
        self.was_interrupted()
    }
}
