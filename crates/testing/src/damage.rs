//! The ways in which a file is damaged.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;

/// Extreme numbers as text.
const WORDS: [&str; 12] = [
    "-1",
    "0",
    "nan",
    "inf",
    "1e308",
    "-1e-308",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "9999999",
    "",
    "\u{feff}",
];

/// Extreme lengths and counts.
const EXTREMES: [u64; 14] = [
    0,
    1,
    4,
    0x7f,
    0x80,
    0xffff,
    1 << 24,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 40,
    u64::MAX >> 1,
    u64::MAX - 8,
    u64::MAX,
];

/// A damaged copy of `good`. Spliced parts come from `seeds`.
pub fn damage(good: &[u8], seeds: &[(String, Vec<u8>)], rng: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for _ in 0..1 + below(rng, 4) {
        once(&mut bytes, seeds, rng);
    }
    bytes
}

fn once(bytes: &mut Vec<u8>, seeds: &[(String, Vec<u8>)], rng: &mut Pcg64Mcg) {
    let at = below(rng, bytes.len() + 1);
    let here = |bytes: &Vec<u8>, length: usize| at..(at + length).min(bytes.len());
    match below(rng, 9) {
        // Truncate.
        0 => bytes.truncate(at),
        // Flip a bit.
        1 => here(bytes, 1).for_each(|i| bytes[i] ^= 1 << below(rng, 8)),
        // Replace a byte.
        2 => here(bytes, 1).for_each(|i| bytes[i] = rng.next_u32() as u8),
        // Replace a number of 1, 2, 4 or 8 bytes by an extreme one, in either byte order.
        3 | 4 => {
            let size = 1 << below(rng, 4);
            let value = EXTREMES[below(rng, EXTREMES.len())];
            let value =
                if below(rng, 2) == 0 { value.to_le_bytes() } else { value.rotate_left(64 - 8 * size).to_be_bytes() };
            for (i, v) in here(bytes, size as usize).zip(value) {
                bytes[i] = v;
            }
        }
        // Remove a range.
        5 => {
            let length = below(rng, 64);
            bytes.drain(here(bytes, length));
        }
        // Repeat a range.
        6 => {
            let length = below(rng, 64);
            let copy = bytes[here(bytes, length)].to_vec();
            bytes.splice(at..at, copy);
        }
        // Insert a range of another file.
        7 => {
            let other = &seeds[below(rng, seeds.len())].1;
            let from = below(rng, other.len() + 1);
            let copy = other[from..(from + below(rng, 256)).min(other.len())].to_vec();
            bytes.splice(at..at, copy);
        }
        // Replace a word.
        _ => {
            let end = (at..bytes.len()).find(|i| bytes[*i].is_ascii_whitespace()).unwrap_or(bytes.len());
            let word = WORDS[below(rng, WORDS.len())];
            bytes.splice(at.min(end)..end.min(at + 24), word.bytes());
        }
    }
}

/// A random number in [0, n); 0 for n = 0.
fn below(rng: &mut Pcg64Mcg, n: usize) -> usize {
    (rng.next_u64() % n.max(1) as u64) as usize
}
