//! Damaged inputs for the tests of every reader. Good files are cut, flipped, spliced and given
//! extreme numbers. A reader must return a result or an error for each, without a panic, in limited
//! time, and with memory in proportion to the size of the file.
//!
//! A test binary that uses [`fuzz_reader`] installs [`PEAK`] as its global allocator. `cargo xtask
//! fuzz` runs these tests with more cases, through the environment variable `TROCAR_FUZZ_CASES`.

use crate::damage::damage;
use crate::peak::PEAK;
use rand_pcg::Pcg64Mcg;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Number of cases of a test unless `TROCAR_FUZZ_CASES` gives another.
const CASES: usize = 2000;
/// Maximum time of a case.
const MAX_CASE_TIME: Duration = Duration::from_secs(5);

/// Maximum memory of a reader: a constant plus a multiple of the input's size.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    /// Bytes for any input.
    pub fixed: usize,
    /// Bytes per byte of the input.
    pub per_byte: usize,
}

/// Number of cases for this run of the tests.
pub fn cases() -> usize {
    std::env::var("TROCAR_FUZZ_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(CASES)
}

/// Runs `read` on [`cases`] damaged versions of `seeds` (name and content) in turn. `read` gets the
/// seed's name and the damaged bytes.
///
/// # Panics
/// If `read` panics, takes longer than five seconds, or allocates more than `allowance` at any
/// time; with the name and number of the case.
pub fn fuzz_reader(seeds: &[(String, Vec<u8>)], allowance: Allowance, mut read: impl FnMut(&str, &[u8])) {
    let cases = cases();
    for case in 0..cases {
        let (name, good) = &seeds[case % seeds.len()];
        let bytes = damage(good, seeds, &mut Pcg64Mcg::new(case as u128));
        let start = Instant::now();
        PEAK.start();
        let outcome = catch_unwind(AssertUnwindSafe(|| read(name, &bytes)));
        let peak = PEAK.since_start();
        let what = format!("case {case} of {cases}, a damaged {name} of {} bytes", bytes.len());
        assert!(outcome.is_ok(), "{what}: panicked");
        assert!(start.elapsed() < MAX_CASE_TIME, "{what}: took {:.1} s", start.elapsed().as_secs_f64());
        let allowed = allowance.fixed + allowance.per_byte * bytes.len();
        assert!(peak <= allowed, "{what}: {peak} bytes allocated, {allowed} allowed");
    }
}
