//! The tables in `docs/generated` are of studies that exist, and of their present schema.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;

#[test]
fn committed_tables_are_of_the_present_schema() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/generated");
    let Ok(entries) = folder.read_dir() else { return };
    let mut wrong = Vec::new();
    for path in entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "md")) {
        let text = std::fs::read_to_string(&path).unwrap();
        wrong.extend(trocar_studies::docs::check(&text).err().map(|why| format!("{}: {why}", path.display())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
