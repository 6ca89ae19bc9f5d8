//! Damaged descriptions of arms give an arm or an error, never a panic. In a program of its own,
//! because it counts allocations.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{MJCF, URDF};
use trocar_robot::chain::SerialArm;
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Memory for the file, its text and the parser's tree.
const ALLOWANCE: Allowance = Allowance { fixed: 1 << 20, per_byte: 100 };

#[test]
fn damage_never_panics() {
    let seeds = [("arm.urdf".to_owned(), URDF.as_bytes().to_vec()), ("arm.xml".to_owned(), MJCF.as_bytes().to_vec())];
    let folder = tempfile::tempdir().unwrap();
    fuzz_reader(&seeds, ALLOWANCE, |name, bytes| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let read = if name.ends_with("urdf") {
            SerialArm::from_urdf(&path, None, Some("tool"))
        } else {
            SerialArm::from_mjcf(&path, "tool")
        };
        match read {
            // An accepted arm is usable.
            Ok(arm) => assert!(arm.mass_matrix(&arm.home()).factor().is_some()),
            Err(error) => {
                let message = error.to_string();
                assert!(message.contains(name), "the file is not named: {message}");
                assert!(!message.contains('\n'), "more than a line: {message}");
            }
        }
    });
}
