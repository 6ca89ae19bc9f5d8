//! Hashes the sources that results depend on: those of phantom specimens, so that a cached specimen
//! is reused only if it would be made the same, and those of episodes, so that two different
//! programs do not write one campaign.
//!
//! A hash covers the version of the crates, which share one, and every listed source that exists.
//! In the repository these are all sources, so that every change counts. In a published package the
//! other crates are not beside this one; a published version never changes, so its number is
//! enough.

use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Crates that make the specimen of a phantom.
const SPECIMEN_SOURCES: [&str; 9] = [
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

/// What an episode depends on: crates, the observations of remote policies, and the versions of all
/// dependencies.
const EPISODE_SOURCES: [&str; 16] = [
    "camera/src",
    "cell/src",
    "core/src",
    "geometry/src",
    "lattice/src",
    "remote/src",
    "render/src",
    "robot/src",
    "scene/src",
    "sensors/src",
    "specimen/src",
    "task/src",
    "sparse/src",
    "tissue/src",
    "campaign/src/remote.rs",
    "../Cargo.lock",
];

fn main() -> std::io::Result<()> {
    println!("cargo:rustc-env=TROCAR_SPECIMEN_SOURCE_HASH={:016x}", hash_of(&SPECIMEN_SOURCES)?);
    println!("cargo:rustc-env=TROCAR_EPISODE_SOURCE_HASH={:016x}", hash_of(&EPISODE_SOURCES)?);
    // A test compares the list with the dependencies of the crates.
    println!("cargo:rustc-env=TROCAR_EPISODE_SOURCES={}", EPISODE_SOURCES.join(" "));
    Ok(())
}

/// Hash of the version and of all files at `sources`, which are relative to the folder of the
/// crates.
fn hash_of(sources: &[&str]) -> std::io::Result<u64> {
    let mut hash = Xxh3::new();
    hash.update(env!("CARGO_PKG_VERSION").as_bytes());
    for source in sources {
        let path = Path::new("..").join(source);
        let mut files = Vec::new();
        list(&path, &mut files)?;
        if !files.is_empty() {
            println!("cargo:rerun-if-changed={}", path.display());
        }
        files.sort();
        for file in files {
            hash.update(file.to_string_lossy().as_bytes());
            hash.update(&std::fs::read(&file)?);
        }
    }
    // Without any existing source, Cargo would rerun this script at every change of the package.
    println!("cargo:rerun-if-changed=build.rs");
    Ok(hash.digest())
}

/// Adds `path`, or all files in it, to `files`. A path that does not exist has none.
fn list(path: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if path.is_file() {
        files.push(path.to_owned());
    } else if path.is_dir() {
        for entry in std::fs::read_dir(path)? {
            list(&entry?.path(), files)?;
        }
    }
    Ok(())
}
