//! Work on the threads of the pool that calls. Outside of a pool the caller does all the work: the
//! global pool is not for it. How work is divided does not depend on the threads.

use rayon::prelude::*;

/// Whether the caller is in a pool of several threads.
pub(crate) fn has_threads() -> bool {
    rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1
}

/// Calls `work` with every item.
pub(crate) fn for_each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
    if has_threads() {
        items.par_iter_mut().with_max_len(1).for_each(work);
    } else {
        items.iter_mut().for_each(work);
    }
}

/// Calls `work` with parts of at most `most` items, and the number of each part's first one.
pub(crate) fn in_parts<T: Send>(items: &mut [T], most: usize, work: impl Fn(usize, &mut [T]) + Send + Sync) {
    let work = |(k, part): (usize, &mut [T])| work(k * most, part);
    if items.len() > most && has_threads() {
        items.par_chunks_mut(most).enumerate().for_each(work);
    } else {
        items.chunks_mut(most).enumerate().for_each(work);
    }
}
