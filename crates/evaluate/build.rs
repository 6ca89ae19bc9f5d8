//! Hashes of sources: of those that make phantoms' specimens, so that one which was kept is used only as long as it would be made the same, and of those that decide what an episode is, so that one
//! campaign is not made by two programs.

use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Crates whose code decides what a phantom's specimen is.
const MAKERS: [&str; 8] =
    ["camera", "geometry", "phantom", "recording", "reconstruct", "render", "segment", "specimen"];

/// Crates whose code decides what an episode is.
const PLAYERS: [&str; 10] =
    ["camera", "cell", "geometry", "render", "robot", "scene", "sight", "specimen", "task", "tissue"];

fn main() -> std::io::Result<()> {
    println!("cargo:rustc-env=TROCAR_SPECIMEN_MAKERS={:016x}", hash_of(&MAKERS)?);
    println!("cargo:rustc-env=TROCAR_EPISODE_MAKERS={:016x}", hash_of(&PLAYERS)?);
    Ok(())
}

fn hash_of(crates: &[&str]) -> std::io::Result<u64> {
    let mut hash = Xxh3::new();
    for name in crates {
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
    Ok(hash.digest())
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
