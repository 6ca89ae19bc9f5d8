//! Only the wanted parts of a large file are read.
//!
//! The measurement needs a bag written by `make_fixtures.py --large`:
//! `TROCAR_LARGE_BAG=/tmp/large.bag cargo test --release -p trocar-recording --test large_bag --
//! --ignored --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test")]

use std::fs::File;
use std::io::{Read, Result, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;
use trocar_recording::messages::{decode_image, open_reader, realsense};

/// A file that counts the bytes read.
struct Counted(File, Arc<AtomicU64>);

impl Read for Counted {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let count = self.0.read(bytes)?;
        self.1.fetch_add(count as u64, Relaxed);
        Ok(count)
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.0.seek(to)
    }
}

#[test]
#[ignore = "needs a large bag"]
fn ninety_frames() {
    let path = std::env::var("TROCAR_LARGE_BAG").unwrap();
    let file = File::open(&path).unwrap();
    let (len, read) = (file.metadata().unwrap().len(), Arc::new(AtomicU64::new(0)));
    let start = Instant::now();
    let log = open_reader(Path::new(&path), Box::new(Counted(file, read.clone()))).unwrap();
    let (opening, to_open) = (start.elapsed(), read.load(Relaxed));
    let found = realsense::find(log.topics()).unwrap();
    let count = log.times(found.depth).len();
    let wanted: Vec<_> = (0..45).flat_map(|i| [(found.depth, i * count / 45), (found.color, i * count / 45)]).collect();
    let start = Instant::now();
    let messages: Vec<_> = log.messages(&wanted).map(|m| (m.topic, m.bytes.unwrap())).collect();
    let (reading, to_read) = (start.elapsed(), read.load(Relaxed) - to_open);
    let start = Instant::now();
    for (topic, bytes) in &messages {
        decode_image(&log.topics()[*topic], bytes).unwrap();
    }
    println!(
        "{len} bytes, {count} frames: opened in {opening:?} ({to_open} bytes), 90 images read in {reading:?} ({to_read} bytes), \
         decoded in {:?}",
        start.elapsed()
    );
    assert!(to_open < len / 50);
    // A chunk holds an image or two.
    let content: usize = messages.iter().map(|m| m.1.len()).sum();
    assert!(to_read < 3 * content as u64);
}
