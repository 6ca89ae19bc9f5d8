//! Long work listens to Ctrl-C: the interpreter's signals are looked at while Rust works.

use pyo3::Python;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use trocar_core::Progress;

/// How often signals are looked at.
const EVERY: Duration = Duration::from_millis(200);

/// Reports nothing, and stops when the user does.
pub struct Signals {
    looked: Mutex<Instant>,
    stopped: AtomicBool,
}

impl Signals {
    pub fn new() -> Self {
        Self { looked: Mutex::new(Instant::now()), stopped: AtomicBool::new(false) }
    }
}

impl Progress for Signals {
    fn begin(&self, _stage: &str, _total: u64) {}

    fn advance(&self, _units: u64) {}

    fn end(&self) {}

    fn interrupted(&self) -> bool {
        if let Ok(mut looked) = self.looked.try_lock()
            && looked.elapsed() > EVERY
        {
            *looked = Instant::now();
            if Python::attach(|py| py.check_signals()).is_err() {
                self.stopped.store(true, Ordering::Relaxed);
            }
        }
        self.stopped.load(Ordering::Relaxed)
    }
}
