//! The checks of the page of `trocar view`: types, build and tests, with Node. They are skipped,
//! with the reason, where Node or the network is missing.

use std::path::Path;
use std::process::{Command, Stdio};

/// The page's folder.
const FOLDER: &str = "viewer";
/// Where the crate that serves the page has it in a package.
const PAGE: &str = "crates/view/page";
/// The oldest Node that the build supports, as `viewer/package.json` says.
const OLDEST: (u32, u32) = (20, 19);

/// Which tests run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Tests {
    /// Those without a browser: seconds.
    Unit,
    /// Those in headless Chromium, too: minutes.
    Browser,
}

/// Builds the page into `viewer/dist` and tests it. `Err` has the name of what failed first.
pub fn check(tests: Tests) -> Result<(), &'static str> {
    eprintln!("\n== page of the live view");
    if let Err(reason) = node() {
        eprintln!("   skipped: {reason}");
        return Ok(());
    }
    if !npm(&["ci", "--no-audit", "--no-fund", "--loglevel=error"]) {
        eprintln!("   skipped: npm ci fails (is there a network?)");
        return Ok(());
    }
    let mut steps = vec![("build", "build"), ("unit tests", "test:unit")];
    if tests == Tests::Browser {
        steps.push(("browser tests", "test:browser"));
    }
    for (name, script) in steps {
        eprintln!("== page: {name}");
        if !npm(&["run", "--silent", script]) {
            return Err(name);
        }
    }
    Ok(())
}

/// Packages all crates into `target/package`, with the page in the one that serves it. The page is
/// put into its folder for that time only: a program of a clone serves `viewer/dist`, which
/// changes.
pub fn package() -> Result<(), String> {
    node().map_err(|why| format!("packages carry the page, which Node builds: {why}"))?;
    let changed = Command::new("git").args(["status", "--porcelain"]).output().map_err(|e| format!("git: {e}"))?;
    if !changed.status.success() || !changed.stdout.is_empty() {
        return Err("packages are made of what is committed; commit first".to_owned());
    }
    if !npm(&["ci", "--no-audit", "--no-fund", "--loglevel=error"]) || !npm(&["run", "--silent", "build"]) {
        return Err("the page cannot be built".to_owned());
    }
    let page = Path::new(PAGE);
    let told = |what: &str, path: &Path, e: std::io::Error| format!("{} cannot be {what}: {e}", path.display());
    let remove = || if page.exists() { std::fs::remove_dir_all(page) } else { Ok(()) };
    remove().map_err(|e| told("removed", page, e))?;
    copy(&Path::new(FOLDER).join("dist"), page).map_err(|e| told("written", page, e))?;
    // Only the page is not committed.
    let packaged = crate::cargo(&["package", "--workspace", "--no-verify", "--locked", "--allow-dirty"], &[]);
    remove().map_err(|e| told("removed", page, e))?;
    if packaged { Ok(()) } else { Err("cargo package fails".to_owned()) }
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

fn npm(arguments: &[&str]) -> bool {
    let status = Command::new("npm").args(arguments).current_dir(FOLDER).stdin(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// Whether Node is there and new enough. `Err` has the reason why not.
fn node() -> Result<(), String> {
    let wanted = format!("Node {}.{} or newer", OLDEST.0, OLDEST.1);
    let output = Command::new("node").arg("--version").output();
    let version = output.map_err(|_| format!("{wanted} is not installed"))?.stdout;
    let version = String::from_utf8_lossy(&version).trim().to_owned();
    let mut numbers = version.trim_start_matches('v').split('.').map(|part| part.parse::<u32>().unwrap_or(0));
    let found = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    if found >= OLDEST { Ok(()) } else { Err(format!("{wanted} is needed; node says {version:?}")) }
}
