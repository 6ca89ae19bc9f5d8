//! Pools of worker threads.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// The most threads that a pool may have. The largest machines have a few hundred cores; a hundred
/// thousand threads, of a slip of the finger, would stall any machine for minutes.
pub const MAX_THREADS: usize = 1024;

/// A pool of `threads` worker threads, or of one for each core (0).
///
/// # Errors
/// More than [`MAX_THREADS`], or threads that the system refuses, as one message.
pub fn thread_pool(threads: usize) -> Result<ThreadPool, String> {
    if threads > MAX_THREADS {
        return Err(format!("{threads} threads; must be in [0, {MAX_THREADS}], where 0 is one for each core"));
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| format!("{threads} threads cannot be started: {e}"))
}

/// Whether the caller is in a pool of several threads. Outside of one it is to do all the work: the
/// global pool is not for it.
pub fn has_threads() -> bool {
    rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pools_have_the_threads_that_were_asked_for_within_bounds() {
        assert_eq!(thread_pool(3).unwrap().current_num_threads(), 3);
        assert!(thread_pool(0).unwrap().current_num_threads() >= 1);
        let refused = thread_pool(100_000).map(|_| ()).unwrap_err();
        assert_eq!(refused, "100000 threads; must be in [0, 1024], where 0 is one for each core");
    }
}
