//! Damaged descriptions with visual shapes give shapes or an error, never a panic. In a program of
//! its own, because it counts allocations.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{shown_mjcf, shown_urdf};
use trocar_robot::chain::{mjcf_visuals, urdf_visuals};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Memory for the file, its text and the parser's tree.
const ALLOWANCE: Allowance = Allowance { fixed: 1 << 20, per_byte: 100 };

#[test]
fn damage_and_cuts_never_panic() {
    let seeds = [("arm.urdf".to_owned(), shown_urdf().into_bytes()), ("arm.xml".to_owned(), shown_mjcf().into_bytes())];
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let seen = if name.ends_with("urdf") {
            urdf_visuals(&path, None, Some("tool"))
        } else {
            mjcf_visuals(&path, Some("tool"))
        };
        match seen {
            // There is always a base.
            Ok(links) => assert!(!links.is_empty()),
            Err(error) => {
                let message = error.to_string();
                assert!(message.contains(name), "the file is not named: {message}");
                assert!(!message.contains('\n'), "more than a line: {message}");
            }
        }
    };
    for (name, good) in &seeds {
        for end in (0..=good.len()).step_by(5) {
            read(name, &good[..end]);
        }
    }
    fuzz_reader(&seeds, ALLOWANCE, read);
}
