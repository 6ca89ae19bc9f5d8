//! How long work tells how far it is, and learns that it should stop.
//!
//! Every stage that can take longer than a second takes a `&dyn Progress`. The command line shows a bar; tests and
//! libraries pass [`Silent`], and [`StopAfter`] where they try an interruption.

use std::sync::atomic::{AtomicU64, Ordering};

/// Receives the progress of long work.
pub trait Progress: Sync {
    /// A stage named `stage` begins and will take `total` units of work.
    fn begin(&self, stage: &str, total: u64);
    /// `units` of the current stage are done.
    fn advance(&self, units: u64);
    /// The current stage is over.
    fn end(&self);
    /// True when the user asked to stop; the work then returns its crate's `Interrupted` error, leaving nothing behind.
    fn interrupted(&self) -> bool;
}

/// Says nothing and is never interrupted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        false
    }
}

/// Says nothing, and asks to stop once so many units of work are done, of all stages together.
#[derive(Debug)]
pub struct StopAfter {
    units: u64,
    done: AtomicU64,
}

impl StopAfter {
    /// After `units`; with none at once.
    pub fn new(units: u64) -> Self {
        Self { units, done: AtomicU64::new(0) }
    }
}

impl Progress for StopAfter {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::SeqCst);
    }
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.done.load(Ordering::SeqCst) >= self.units
    }
}
