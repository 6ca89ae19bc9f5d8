//! Work on the threads of the pool that calls. Outside of a pool the caller does all the work: the
//! global pool is not for it. How work is divided does not depend on the threads.

use rayon::prelude::*;
use trocar_core::has_threads;

/// Parts that items are divided into, at most.
const MAX_PARTS: usize = 8;

/// Calls `work` with every item.
pub(crate) fn for_each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
    if has_threads() {
        items.par_iter_mut().with_max_len(1).for_each(work);
    } else {
        items.iter_mut().for_each(work);
    }
}

/// Calls `work` with parts of at least `least` items, at most eight of equal size, and the number
/// of each part's first one.
pub(crate) fn in_parts<T: Send>(items: &mut [T], least: usize, work: impl Fn(usize, &mut [T]) + Send + Sync) {
    let parts = (items.len() / least).clamp(1, MAX_PARTS);
    if parts == 1 || !has_threads() {
        return work(0, items);
    }
    let size = items.len().div_ceil(parts);
    items.par_chunks_mut(size).enumerate().for_each(|(k, part)| work(k * size, part));
}
