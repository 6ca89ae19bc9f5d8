//! Trials in parallel.

use crate::{Error, Result};
use rayon::prelude::*;
use trocar_core::Progress;

/// Calls `run` for every item on `threads` threads (0: all) and returns the outcomes in the order
/// of the items. `finished` counts earlier items in the progress.
pub(crate) fn side_by_side<T: Sync, R: Send>(
    stage: &str,
    items: &[T],
    (finished, threads): (usize, usize),
    progress: &dyn Progress,
    run: impl Fn(&T, &dyn Progress) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Mismatch(format!("{threads} threads cannot be started: {e}")))?;
    progress.begin(stage, (finished + items.len()) as u64);
    progress.advance(finished as u64);
    let quiet = Quiet(progress);
    let outcomes = pool.install(|| {
        let each = items.par_iter().with_max_len(1).map(|item| {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let outcome = run(item, &quiet);
            progress.advance(1);
            outcome
        });
        each.collect()
    });
    progress.end();
    outcomes
}

/// Passes the request to stop to a trial and drops its progress: trials run in parallel.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}
