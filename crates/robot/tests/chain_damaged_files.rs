//! Damaged descriptions of arms give an arm, shapes or an error, never a panic. In a program of its
//! own with a single test, because it counts allocations.

#![allow(clippy::unwrap_used, reason = "helper functions of tests")]

mod common;

use common::files::{MJCF, URDF, shown_mjcf, shown_urdf};
use std::path::Path;
use trocar_robot::Result;
use trocar_robot::chain::{SerialArm, mjcf_visuals, urdf_visuals};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// Memory for the file, its text and the parser's tree.
const ALLOWANCE: Allowance = Allowance { fixed: 1 << 20, per_byte: 100 };

#[test]
fn damage_never_panics() {
    fuzz([URDF, MJCF], 40, |path, urdf| {
        let arm =
            if urdf { SerialArm::from_urdf(path, None, Some("tool")) } else { SerialArm::from_mjcf(path, "tool") }?;
        assert!(arm.mass_matrix(&arm.home()).factor().is_some(), "an accepted arm is usable");
        Ok(())
    });
    fuzz([&shown_urdf(), &shown_mjcf()], 5, |path, urdf| {
        let links = if urdf { urdf_visuals(path, None, Some("tool")) } else { mjcf_visuals(path, Some("tool")) }?;
        assert!(!links.is_empty(), "there is always a base");
        Ok(())
    });
}

/// Reads damaged versions of a URDF and an MJCF file, and all their beginnings in steps of `step`
/// bytes.
fn fuzz(texts: [&str; 2], step: usize, read: impl Fn(&Path, bool) -> Result<()>) {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        if let Err(error) = read(&path, name.ends_with("urdf")) {
            let message = error.to_string();
            assert!(message.contains(name), "the file is not named: {message}");
            assert!(!message.contains('\n'), "more than a line: {message}");
        }
    };
    let seeds = [("arm.urdf", texts[0]), ("arm.xml", texts[1])];
    let seeds = seeds.map(|(name, text)| (name.to_owned(), text.as_bytes().to_vec()));
    for (name, good) in &seeds {
        for end in (0..=good.len()).step_by(step) {
            read(name, &good[..end]);
        }
    }
    fuzz_reader(&seeds, ALLOWANCE, read);
}
