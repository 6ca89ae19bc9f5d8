//! Trials in parallel.

use crate::{Error, Result};
use rayon::prelude::*;
use trocar_core::{Progress, Quiet};

/// Calls `run` for every index below `count` on `threads` threads (0: all). The progress starts at
/// the `finished` trials of earlier runs.
pub(crate) fn side_by_side(
    stage: &str,
    count: usize,
    (finished, threads): (usize, usize),
    progress: &dyn Progress,
    run: &(dyn Fn(usize, &dyn Progress) -> Result<()> + Sync),
) -> Result<()> {
    let pool = trocar_core::thread_pool(threads).map_err(Error::Mismatch)?;
    progress.begin(stage, (finished + count) as u64);
    progress.advance(finished as u64);
    let quiet = Quiet(progress);
    let one = |k| {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let outcome = run(k, &quiet);
        progress.advance(1);
        outcome
    };
    let outcome = pool.install(|| (0..count).into_par_iter().with_max_len(1).try_for_each(one));
    progress.end();
    outcome
}
