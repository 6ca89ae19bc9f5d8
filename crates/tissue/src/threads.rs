//! Work on the threads of the pool that calls. Outside of a pool the caller does all the work: the
//! global pool is not for it. How work is divided does not depend on the threads.
//!
//! A step has hundreds of short sections that several threads share. A thread of a pool falls
//! asleep soon after it has no work, and to wake it takes as long as a section does. So after a
//! section the other threads linger for a while.

use rayon::prelude::*;
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use trocar_core::has_threads;

/// Parts that items are divided into, at most.
const MAX_PARTS: usize = 8;

/// How long a thread waits awake for the next section.
const LINGER: Duration = Duration::from_micros(200);

/// Pauses of the processor between two looks for work.
const PAUSES: usize = 16;

/// Looks for work between two offers of the core to other programs.
const LOOKS: usize = 64;

thread_local! {
    /// Threads that linger for this one's sections.
    static LINGERING: Arc<AtomicUsize> = Arc::default();
    /// Whether this thread lingers.
    static LINGERS: Cell<bool> = const { Cell::new(false) };
    /// Sections that this thread is inside of. While it waits for one it must not linger.
    static SECTIONS: Cell<usize> = const { Cell::new(0) };
}

/// Calls `work` with every item.
pub(crate) fn for_each<T: Send>(items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
    if items.len() > 1 && has_threads() {
        section(|| items.par_iter_mut().with_max_len(1).for_each(work));
    } else {
        items.iter_mut().for_each(work);
    }
}

/// Calls `work` with every item and its companion.
pub(crate) fn for_each_with<T: Send, U: Send>(
    items: &mut [T],
    companions: &mut [U],
    work: impl Fn(&mut T, &mut U) + Send + Sync,
) {
    if items.len() > 1 && has_threads() {
        let pairs = items.par_iter_mut().zip(companions).with_max_len(1);
        section(|| pairs.for_each(|(item, companion)| work(item, companion)));
    } else {
        items.iter_mut().zip(companions).for_each(|(item, companion)| work(item, companion));
    }
}

/// Calls `work` with two, four or eight parts of at least `least` items, or with all items, and the
/// number of each part's first one. Parts are of equal size, and there are never three: two threads
/// need two thirds of the time for three parts, and half of it for two or four.
pub(crate) fn in_parts<T: Send>(items: &mut [T], least: usize, work: impl Fn(usize, &mut [T]) + Send + Sync) {
    let parts = 1 << (items.len() / least).clamp(1, MAX_PARTS).ilog2();
    if parts == 1 || !has_threads() {
        return work(0, items);
    }
    section(|| in_halves(items, parts, 0, &work));
}

/// Calls `work` with so many `parts` of items, a power of two; the first item has a number.
fn in_halves<T: Send>(items: &mut [T], parts: usize, first: usize, work: &(impl Fn(usize, &mut [T]) + Sync)) {
    if parts == 1 {
        return work(first, items);
    }
    let middle = items.len() / 2;
    let (one, other) = items.split_at_mut(middle);
    rayon::join(|| in_halves(one, parts / 2, first, work), || in_halves(other, parts / 2, first + middle, work));
}

/// Does both, on two threads of the pool that calls if both are free.
pub(crate) fn join<A: Send, B: Send>(first: impl FnOnce() -> A + Send, second: impl FnOnce() -> B + Send) -> (A, B) {
    section(|| rayon::join(first, second))
}

/// Does `work` that several threads share, and keeps them awake for the next, unless this section
/// is a part of another one.
fn section<R>(work: impl FnOnce() -> R) -> R {
    SECTIONS.set(SECTIONS.get() + 1);
    let result = work();
    SECTIONS.set(SECTIONS.get() - 1);
    if SECTIONS.get() == 0 {
        keep_awake();
    }
    result
}

/// Lets the other threads of the pool wait awake for the caller's next section.
fn keep_awake() {
    let Some(owner) = rayon::current_thread_index() else { return };
    LINGERING.with(|lingering| {
        let others = (rayon::current_num_threads() - 1).min(MAX_PARTS - 1);
        if lingering.load(Ordering::Relaxed) < others {
            lingering.fetch_add(1, Ordering::Relaxed);
            let lingering = lingering.clone();
            rayon::spawn(move || {
                if rayon::current_thread_index() != Some(owner) {
                    linger();
                }
                lingering.fetch_sub(1, Ordering::Relaxed);
            });
        }
    });
}

/// Does what work there is until there has been none for a while.
fn linger() {
    if SECTIONS.get() > 0 || LINGERS.replace(true) {
        return;
    }
    let mut last = Instant::now();
    let mut looks = 0;
    while last.elapsed() < LINGER {
        looks += 1;
        match rayon::yield_now() {
            Some(rayon::Yield::Executed) => last = Instant::now(),
            // Other programs may have work for the core.
            _ if looks % LOOKS == 0 => std::thread::yield_now(),
            _ => (0..PAUSES).for_each(|_| std::hint::spin_loop()),
        }
    }
    LINGERS.set(false);
}
