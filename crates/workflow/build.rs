//! Hashes of sources: of those that make phantoms' specimens, so that one which was kept is used
//! only as long as it would be made the same, and of those that decide what an episode is, so that
//! one campaign is not made by two programs.

use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Crates whose code decides what a phantom's specimen is.
const MAKERS: [&str; 9] = [
    "camera/src",
    "core/src",
    "geometry/src",
    "phantom/src",
    "recording/src",
    "reconstruct/src",
    "render/src",
    "segment/src",
    "specimen/src",
];

/// What decides what an episode is: crates, what policies of other processes are shown and how they
/// are asked, and the versions of all that is built in.
const PLAYERS: [&str; 14] = [
    "camera/src",
    "cell/src",
    "core/src",
    "geometry/src",
    "remote/src",
    "render/src",
    "robot/src",
    "scene/src",
    "sensors/src",
    "specimen/src",
    "task/src",
    "tissue/src",
    "campaign/src/remote.rs",
    "../Cargo.lock",
];

fn main() -> std::io::Result<()> {
    println!("cargo:rustc-env=TROCAR_SPECIMEN_MAKERS={:016x}", hash_of(&MAKERS)?);
    println!("cargo:rustc-env=TROCAR_EPISODE_MAKERS={:016x}", hash_of(&PLAYERS)?);
    // A test compares it with what is depended on.
    println!("cargo:rustc-env=TROCAR_EPISODE_SOURCES={}", PLAYERS.join(" "));
    Ok(())
}

/// Hash of files, and of all files in folders; both as seen from the folder of the crates.
fn hash_of(sources: &[&str]) -> std::io::Result<u64> {
    let mut hash = Xxh3::new();
    for name in sources {
        let place = Path::new("..").join(name);
        println!("cargo:rerun-if-changed={}", place.display());
        let mut files = Vec::new();
        if place.is_dir() {
            list(&place, &mut files)?;
        } else {
            files.push(place);
        }
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
