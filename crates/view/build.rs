//! Puts the built page into the program: the one of the folder `page`, which packages have, or with
//! the feature `page` one that npm builds here from the folder `viewer` of a clone. Otherwise there
//! is none, and the program serves `viewer/dist`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What of the folder `viewer` the page is built from.
const SOURCES: [&str; 8] = [
    "index.html",
    "package.json",
    "package-lock.json",
    "tsconfig.json",
    "vite-env.d.ts",
    "vite.config.ts",
    "src",
    "public",
];

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    println!("cargo:rerun-if-changed=page");
    println!("cargo:rerun-if-changed=build.rs");
    let folder = PathBuf::from(std::env::var("CARGO_MANIFEST_DIR")?);
    let output = PathBuf::from(std::env::var("OUT_DIR")?);
    let mut root = folder.join("page");
    let sources = folder.join("../../viewer");
    if !root.is_dir() && std::env::var_os("CARGO_FEATURE_PAGE").is_some() && sources.is_dir() {
        for name in SOURCES {
            println!("cargo:rerun-if-changed={}", sources.join(name).display());
        }
        let place = output.join("viewer");
        match built(&sources, &place) {
            Ok(()) => root = place.join("dist"),
            Err(why) => {
                println!("cargo:warning=the page of the live view is not built, and trocar.view says so: {why}");
            }
        }
    }
    let mut files = Vec::new();
    if root.is_dir() {
        list(&root, &mut files)?;
    }
    files.sort();
    let mut text = String::from("/// Names and contents of the page's files.\nstatic FILES: &[(&str, &[u8])] = &[\n");
    for file in &files {
        let name = file.strip_prefix(&root)?.to_string_lossy().replace('\\', "/");
        writeln!(text, "    ({name:?}, include_bytes!({:?})),", file.display().to_string())?;
    }
    text.push_str("];\n");
    std::fs::write(output.join("page_files.rs"), text)?;
    Ok(())
}

/// Builds the page of `sources` in `place`: a build script writes nowhere else.
fn built(sources: &Path, place: &Path) -> Result<()> {
    if place.is_dir() {
        std::fs::remove_dir_all(place)?;
    }
    std::fs::create_dir_all(place)?;
    for name in SOURCES {
        copy(&sources.join(name), &place.join(name))?;
    }
    let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
    for arguments in [&["ci", "--no-audit", "--no-fund", "--loglevel=error"][..], &["run", "--silent", "build"]] {
        let mut command = Command::new(npm);
        command.args(arguments).current_dir(place).stdin(Stdio::null());
        let output = command.output().map_err(|_| "Node 20.19 or newer with npm is not installed")?;
        if !output.status.success() {
            let told = [output.stderr, output.stdout].map(|text| String::from_utf8_lossy(&text).trim().to_owned());
            let told = told.iter().flat_map(|text| text.lines()).next().unwrap_or("it says nothing");
            return Err(format!("npm {} fails: {told}", arguments[0]).into());
        }
    }
    std::fs::remove_dir_all(place.join("node_modules"))?;
    Ok(())
}

/// Copies a file, or a folder with what is in it.
fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    if from.is_dir() {
        std::fs::create_dir_all(to)?;
        for entry in std::fs::read_dir(from)? {
            let entry = entry?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    std::fs::copy(from, to).map(|_| ())
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
