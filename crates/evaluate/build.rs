//! A hash of the sources that phantoms' specimens are made by, so that one which was kept is used only as long as it would be made the same.

use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Crates whose code decides what a phantom's specimen is.
const MAKERS: [&str; 8] =
    ["camera", "geometry", "phantom", "recording", "reconstruct", "render", "segment", "specimen"];

fn main() -> std::io::Result<()> {
    let mut hash = Xxh3::new();
    for name in MAKERS {
        let folder = Path::new("..").join(name).join("src");
        println!("cargo:rerun-if-changed={}", folder.display());
        let mut files = Vec::new();
        list(&folder, &mut files)?;
        files.sort();
        for file in files {
            hash.update(file.to_string_lossy().as_bytes());
            hash.update(&std::fs::read(&file)?);
        }
    }
    println!("cargo:rustc-env=TROCAR_SPECIMEN_MAKERS={:016x}", hash.digest());
    Ok(())
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
