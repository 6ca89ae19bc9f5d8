//! Progress of long work, and requests to stop it.
//!
//! Every stage that can take longer than a second takes a `&dyn Progress`. The command line shows a
//! bar. Libraries pass [`Silent`]; tests of interruptions pass [`StopAfter`].

use std::sync::atomic::{AtomicU64, Ordering};

/// Receives the progress of long work.
///
/// ```
/// use trocar_core::{Progress, StopAfter};
///
/// let progress = StopAfter::new(3);
/// progress.begin("meshing", 10);
/// let mut done = 0;
/// while done < 10 && !progress.interrupted() {
///     done += 1;
///     progress.advance(1);
/// }
/// progress.end();
/// assert_eq!(done, 3);
/// ```
pub trait Progress: Sync {
    /// The stage `stage` begins. It takes `total` units of work.
    fn begin(&self, stage: &str, total: u64);
    /// `units` more of the current stage are done.
    fn advance(&self, units: u64);
    /// The current stage is over.
    fn end(&self);
    /// Whether the user asked to stop. The work then returns its crate's `Interrupted` error and
    /// leaves nothing behind.
    fn interrupted(&self) -> bool;
}

/// Reports nothing and is never interrupted.
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

/// Reports nothing and passes the request to stop on, for parts of work that has its own progress.
pub struct Quiet<'a>(pub &'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}

/// Reports nothing and asks to stop after a number of units of work, over all stages together.
#[derive(Debug)]
pub struct StopAfter {
    units: u64,
    done: AtomicU64,
}

impl StopAfter {
    /// Asks to stop after `units` units of work; at once for 0.
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
