//! Damaged scenes give a scene or a one-line error: no panic, no hang, no memory beyond what their
//! size needs.
#![allow(clippy::unwrap_used, reason = "tests")]

use trocar_scene::{BUILTINS, Scene};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// A line of numbers of two bytes each becomes spanned values and then fields.
const ALLOWANCE: Allowance = Allowance { fixed: 4 << 20, per_byte: 1000 };

#[test]
fn damage_never_panics() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("scene.toml");
    let mut seeds = Vec::new();
    for builtin in BUILTINS {
        seeds.push((builtin.name.to_owned(), builtin.text.as_bytes().to_vec()));
        let canonical = Scene::builtin(builtin.name).unwrap().to_toml().unwrap();
        seeds.push((format!("canonical {}", builtin.name), canonical.into_bytes()));
    }
    let mut refused = 0;
    fuzz_reader(&seeds, ALLOWANCE, |_, bytes| {
        std::fs::write(&path, bytes).unwrap();
        match Scene::read_file(&path) {
            Ok(scene) => drop(scene.to_toml().unwrap()),
            Err(e) => {
                let text = e.to_string();
                assert!(!text.contains('\n') && text.contains("scene.toml") && text.len() < 2000, "{text}");
                refused += 1;
            }
        }
    });
    assert!(refused > 100, "{refused}");
}
