//! Damaged specimens give a specimen or a one-line error: no panic, no hang, no memory beyond what
//! their size needs.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use std::fs;
use trocar_specimen::Specimen;
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// The background is a PNG, which holds up to a thousand times its size.
const ALLOWANCE: Allowance = Allowance { fixed: 16 << 20, per_byte: 3000 };

#[test]
fn damage_never_panics() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("specimen");
    common::specimen().write(&dir).unwrap();
    let names = ["specimen.toml", "appendix.msh", "appendix.ply", "bowel-1.msh", "background.png"];
    let seeds: Vec<(String, Vec<u8>)> = names.map(|n| (n.to_owned(), fs::read(dir.join(n)).unwrap())).into();
    fuzz_reader(&seeds, ALLOWANCE, |name, bytes| {
        let path = dir.join(name);
        fs::write(&path, bytes).unwrap();
        if let Err(e) = Specimen::read(&dir) {
            let text = e.to_string();
            assert!(!text.contains('\n') && !text.is_empty(), "{text}");
        }
        let good = seeds.iter().find(|s| s.0 == name).unwrap();
        fs::write(&path, &good.1).unwrap();
    });
}
