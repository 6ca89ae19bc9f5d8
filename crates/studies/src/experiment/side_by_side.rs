//! Trials side by side.

use crate::{Error, Result};
use rayon::prelude::*;
use trocar_core::Progress;

/// Does `run` for every item, several at once on `threads` threads (0: all there are), after `finished` others; the outcomes are in the items' order.
pub(super) fn side_by_side<T: Sync, R: Send>(
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

/// Lets a trial know that it is to stop and hears nothing of it: trials run at once.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}
