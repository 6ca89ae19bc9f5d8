//! The system's allocator with a count of allocations and a measurement of peak memory.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

thread_local! {
    /// Number of allocations of the thread. It needs no memory of its own and no destructor.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

/// An allocator that counts allocations and allocated bytes of all threads.
#[derive(Debug)]
pub struct Peak {
    now: AtomicUsize,
    most: AtomicUsize,
    start: AtomicUsize,
    count: AtomicUsize,
}

/// A test binary installs it by `#[global_allocator] static ALLOCATOR: &Peak = &PEAK;`
pub static PEAK: Peak = Peak {
    now: AtomicUsize::new(0),
    most: AtomicUsize::new(0),
    start: AtomicUsize::new(0),
    count: AtomicUsize::new(0),
};

impl Peak {
    /// Begins a measurement.
    pub fn start(&self) {
        let now = self.now.load(Ordering::Relaxed);
        self.start.store(now, Ordering::Relaxed);
        self.most.store(now, Ordering::Relaxed);
    }

    /// Peak memory since [`Peak::start`], minus the memory in use then (bytes).
    pub fn since_start(&self) -> usize {
        self.most.load(Ordering::Relaxed).saturating_sub(self.start.load(Ordering::Relaxed))
    }

    /// Number of allocations of the calling thread so far. The test harness allocates in a thread
    /// of its own, at any time.
    pub fn allocations_of_thread(&self) -> usize {
        COUNT.try_with(Cell::get).unwrap_or_default()
    }

    /// Number of allocations of all threads so far.
    pub fn allocations(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    fn grew(&self, by: usize) {
        self.count.fetch_add(1, Ordering::Relaxed);
        let _ = COUNT.try_with(|count| count.set(count.get() + 1));
        let now = self.now.fetch_add(by, Ordering::Relaxed) + by;
        self.most.fetch_max(now, Ordering::Relaxed);
    }
}

#[allow(unsafe_code, reason = "an allocator cannot be written without")]
// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for &Peak {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        self.grew(layout.size());
        // SAFETY: the caller's promises are handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        self.grew(layout.size());
        // SAFETY: the caller's promises are handed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        self.now.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from `alloc`, that is, from the system.
        unsafe { System.dealloc(pointer, layout) }
    }
}
