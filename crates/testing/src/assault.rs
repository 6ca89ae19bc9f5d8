//! Damaged inputs for the tests of every reader: good files are cut, flipped, spliced and given extreme numbers; a reader must
//! answer each with a result or an error, without a panic, soon, and without taking more memory than the file's size calls for.
//!
//! A test binary that uses [`assault`] installs [`PEAK`] as its global allocator. `cargo xtask fuzz` runs all of them with many
//! more cases than the test suite does, by way of the environment variable `TROCAR_FUZZ_CASES`.

use crate::damage::damage;
use crate::peak::PEAK;
use rand_pcg::Pcg64Mcg;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Cases a test runs where `TROCAR_FUZZ_CASES` says nothing else.
const CASES: usize = 2000;
/// A case that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(5);

/// What a reader may allocate at most: a constant, and a multiple of the input's size.
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

/// Runs `read` on [`cases`] damaged versions of `seeds` (name and content), shared out evenly. `read` gets the seed's name and the
/// damaged bytes.
///
/// # Panics
/// With the name and the number of the case when `read` panics, takes longer than five seconds, or has more than `allowance`
/// allocated at any time.
pub fn assault(seeds: &[(String, Vec<u8>)], allowance: Allowance, mut read: impl FnMut(&str, &[u8])) {
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
        assert!(start.elapsed() < PATIENCE, "{what}: took {:.1} s", start.elapsed().as_secs_f64());
        let allowed = allowance.fixed + allowance.per_byte * bytes.len();
        assert!(peak <= allowed, "{what}: {peak} bytes allocated, {allowed} allowed");
    }
}
