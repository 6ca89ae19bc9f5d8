//! The page's files: of the built page in `viewer/dist` of a clone, or those that the program
//! carries.

use std::path::{Path, PathBuf};
use std::process::Stdio;

include!(concat!(env!("OUT_DIR"), "/page_files.rs"));

/// Where the page's files are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Page {
    /// In a folder.
    Folder(PathBuf),
    /// In the program.
    Carried,
    /// Nowhere: what to do about it.
    Missing,
}

/// The page that is shown if none is built.
const MISSING: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>trocar view</title>\
     <body><h1>The page is not built</h1><p>This program is built from a clone of the repository. With Node 20 or \
     later, run <code>npm ci &amp;&amp; npm run build</code> in its folder <code>viewer</code>, then load this page \
     again. The wire for other clients works without it.</p></body></html>";

/// The commands that build the page in a clone.
const HOW: &str = "npm ci && npm run build";

/// Builds the page if a clone has none and npm is available. If that fails, it returns a line that
/// says what to do.
pub fn build_page() -> Option<String> {
    let folder = sources().filter(|_| Page::find() == Page::Missing)?;
    let shown = folder.canonicalize().unwrap_or_else(|_| folder.clone());
    let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
    for arguments in [&["ci"][..], &["run", "build"]] {
        let mut command = std::process::Command::new(npm);
        command.args(arguments).current_dir(&folder).stdin(Stdio::null()).stdout(Stdio::null());
        match command.status() {
            Ok(status) if status.success() => {}
            Ok(_) => return Some(format!("the page cannot be built; run {HOW} in {} to see why", shown.display())),
            Err(_) => return Some(format!("the page needs Node 20 or later; run {HOW} in {}", shown.display())),
        }
    }
    None
}

/// The folder `viewer` of the clone that this program was built in, if it is still there.
fn sources() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../viewer");
    folder.join("package.json").is_file().then_some(folder)
}

impl Page {
    /// The page that this program has.
    pub fn find() -> Self {
        if !FILES.is_empty() {
            return Self::Carried;
        }
        match sources().map(|folder| folder.join("dist")) {
            Some(dist) if dist.join("index.html").is_file() => Self::Folder(dist),
            _ => Self::Missing,
        }
    }

    /// The contents and type of the file at the path of an address.
    pub fn file(&self, path: &str) -> Option<(Vec<u8>, &'static str)> {
        let name = if path == "/" { "index.html" } else { path.strip_prefix('/')? };
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_./".contains(c);
        if !name.chars().all(plain) || name.split('/').any(|part| part.is_empty() || part.starts_with('.')) {
            return None;
        }
        let bytes = match self {
            Self::Folder(folder) => std::fs::read(folder.join(name)).ok()?,
            Self::Carried => FILES.iter().find(|(own, _)| *own == name)?.1.to_vec(),
            Self::Missing if name == "index.html" => MISSING.as_bytes().to_vec(),
            Self::Missing => return None,
        };
        Some((bytes, kind_of(name)))
    }
}

fn kind_of(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_the_page_are_given() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("assets")).unwrap();
        std::fs::write(folder.path().join("index.html"), "x").unwrap();
        std::fs::write(folder.path().join("assets/a.js"), "y").unwrap();
        let page = Page::Folder(folder.path().to_owned());
        assert_eq!(page.file("/").unwrap().0, b"x");
        assert_eq!(page.file("/assets/a.js").unwrap(), (b"y".to_vec(), "text/javascript; charset=utf-8"));
        for path in ["/../index.html", "/assets/../index.html", "//index.html", "/%2e%2e/x", "/none", "", "/assets"] {
            assert_eq!(page.file(path), None, "{path}");
        }
    }
}
