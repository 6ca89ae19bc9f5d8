//! Packages of all crates, with what they carry beyond their own folder: the licence texts, and in
//! one crate the page of `trocar view`.

use crate::viewer;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where the crate that serves the page has it in a package.
const PAGE: &str = "crates/view/page";
/// The licence texts, which every crate carries.
const LICENCES: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];

/// Packages all crates into `target/package`. What they carry from elsewhere is in their folders
/// for that time only: a program of a clone serves `viewer/dist`, which changes.
pub fn package() -> Result<(), String> {
    let changed = Command::new("git").args(["status", "--porcelain"]).output().map_err(|e| format!("git: {e}"))?;
    if !changed.status.success() || !changed.stdout.is_empty() {
        return Err("packages contain committed files only; commit first".to_owned());
    }
    viewer::build()?;
    let root = Path::new(".");
    let put = remove(root).and_then(|()| put(root));
    // Only what was put there is not committed.
    let packaged =
        put.is_ok() && crate::cargo(&["package", "--workspace", "--no-verify", "--locked", "--allow-dirty"], &[]);
    let removed = remove(root);
    put.and(removed).map_err(|e| format!("licence texts and page cannot be copied or removed: {e}"))?;
    if packaged { Ok(()) } else { Err("cargo package fails".to_owned()) }
}

/// The folders of the packages.
fn folders(root: &Path) -> io::Result<Vec<PathBuf>> {
    let all = root.join("crates").read_dir()?.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    Ok(all.into_iter().filter(|folder| folder.join("Cargo.toml").is_file()).collect())
}

/// Puts licence texts and page into the folders of the packages.
fn put(root: &Path) -> io::Result<()> {
    for folder in folders(root)? {
        for name in LICENCES {
            std::fs::copy(root.join(name), folder.join(name))?;
        }
    }
    copy(&root.join(viewer::FOLDER).join("dist"), &root.join(PAGE))
}

/// Takes them away again.
fn remove(root: &Path) -> io::Result<()> {
    let page = root.join(PAGE);
    if page.exists() {
        std::fs::remove_dir_all(page)?;
    }
    for file in folders(root)?.iter().flat_map(|folder| LICENCES.map(|name| folder.join(name))) {
        if file.exists() {
            std::fs::remove_file(file)?;
        }
    }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn root() -> &'static Path {
        Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
    }

    #[test]
    fn every_package_has_its_licences_for_the_time_of_packaging() {
        let copied = std::env::temp_dir().join(format!("trocar-package-{}", std::process::id()));
        std::fs::create_dir_all(copied.join("crates/view")).unwrap();
        std::fs::create_dir_all(copied.join("viewer/dist")).unwrap();
        std::fs::write(copied.join("crates/view/Cargo.toml"), "").unwrap();
        std::fs::write(copied.join("viewer/dist/index.html"), "page").unwrap();
        for name in LICENCES {
            std::fs::copy(root().join(name), copied.join(name)).unwrap();
        }
        put(&copied).unwrap();
        let there = ["LICENSE-APACHE", "LICENSE-MIT", "page/index.html"].map(|f| copied.join("crates/view").join(f));
        assert!(there.iter().all(|file| file.is_file()));
        remove(&copied).unwrap();
        assert!(there.iter().all(|file| !file.exists()));
        std::fs::remove_dir_all(&copied).unwrap();
    }

    #[test]
    fn the_readme_of_every_package_names_the_licence_and_links_to_nothing_outside() {
        let folders = folders(root()).unwrap();
        assert!(folders.len() > 20, "{}", folders.len());
        for folder in folders {
            let text = std::fs::read_to_string(folder.join("README.md")).unwrap();
            assert!(text.contains("Licensed under MIT or Apache-2.0."), "{}", folder.display());
            assert!(!text.contains("](../"), "{}", folder.display());
            let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
            let carried = !manifest.contains("\ninclude") || manifest.contains("\"LICENSE-*\"");
            assert!(carried, "{}: include lacks the licence texts", folder.display());
        }
    }
}
