//! Other programs that tests compare with.
#![allow(clippy::print_stdout, reason = "a skipped test says so")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The Python interpreter of `target/tools`, where `cargo xtask tools` puts programs for tests, if
/// it can do `import MODULES`. Otherwise it prints that the test of `name` is skipped.
pub fn python_with(modules: &str, name: &str) -> Option<PathBuf> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tools/bin/python");
    let imports = Command::new(&python).args(["-c", &format!("import {modules}")]).output();
    if imports.is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    println!("skipped: no {name} in target/tools; `cargo xtask tools` fetches it");
    None
}
