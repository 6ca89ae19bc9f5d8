//! Damaged files of every kind give messages or errors: no panic, no hang, no memory beyond what
//! the file holds.
//!
//! Half of the cases damage a file; the others damage a message, which bypasses checksums and
//! compression.

#![allow(clippy::unwrap_used, reason = "a test")]

mod common;

use common::{ALL, decode_all, fixture, log, read_all};
use std::io::Cursor;
use std::path::Path;
use trocar_recording::messages::{Topic, find_rgbd_topics, open_reader};
use trocar_testing::{Allowance, PEAK, Peak, cases, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Fixed: the buffers of LZ4 (two blocks of 4 MiB and a window), a small image's free growth,
/// Zstandard's window of 8 MiB and its tables. Per byte: an image of one colour, and compressed
/// chunks.
const ALLOWANCE: Allowance = Allowance { fixed: 24 << 20, per_byte: 600 };

/// The first three messages of every topic of every fixture.
fn messages() -> Vec<(Topic, Vec<u8>)> {
    let mut all = Vec::new();
    for name in ALL {
        let log = log(name);
        let wanted: Vec<_> = (0..log.topics().len()).flat_map(|t| (0..3).map(move |i| (t, i))).collect();
        let had = log.messages(&wanted).filter_map(|m| Some((log.topics()[m.topic].clone(), m.bytes.ok()?)));
        all.extend(had);
    }
    all
}

#[test]
fn damage_never_panics() {
    let messages = messages();
    // As many files as messages, so that each kind gets half of the cases.
    let file = |i: usize| (ALL[i % ALL.len()].to_owned(), std::fs::read(fixture(ALL[i % ALL.len()])).unwrap());
    let seeds: Vec<(String, Vec<u8>)> =
        (0..messages.len()).flat_map(|i| [file(i), (format!("message {i}"), messages[i].1.clone())]).collect();
    let (mut opened, mut decoded, mut direct) = (0, 0, 0);
    fuzz_reader(&seeds, ALLOWANCE, |name, bytes| {
        if let Some(i) = name.strip_prefix("message ") {
            direct += usize::from(decode_all(&messages[i.parse::<usize>().unwrap()].0, bytes));
        } else if let Ok(log) = open_reader(Path::new("damaged"), Box::new(Cursor::new(bytes.to_vec()))) {
            decoded += read_all(&*log).1;
            let _ = find_rgbd_topics(&*log, None, None);
            opened += 1;
        }
    });
    let cases = cases();
    println!(
        "{cases} cases: {opened} files opened, {decoded} of their messages decoded; {direct} damaged messages decoded"
    );
    // The damage leaves enough intact to reach the decoders.
    assert!(opened > cases / 4 && decoded > cases && direct > cases / 20, "{opened}, {decoded}, {direct} of {cases}");
}
