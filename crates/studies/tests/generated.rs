//! The studies of the tables in `docs/generated` exist and have the same schema. No study writes
//! the table of learned policies: `cargo xtask figures learning` does.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

#[test]
fn committed_tables_have_the_current_schema() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/generated");
    let Ok(entries) = folder.read_dir() else { return };
    let mut wrong = Vec::new();
    let tables = entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "md"));
    for path in tables.filter(|p| p.file_stem().is_some_and(|s| s != "learning")) {
        let text = std::fs::read_to_string(&path).unwrap();
        wrong.extend(trocar_studies::docs::check(&text).err().map(|why| format!("{}: {why}", path.display())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
