//! The checks of the page of `trocar view`: types, build and tests, with Node. They are skipped,
//! with the reason, where Node or the network is missing.

use std::process::{Command, Stdio};

/// The page's folder.
pub const FOLDER: &str = "viewer";
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

/// Builds the page of this moment into `viewer/dist`.
pub fn build() -> Result<(), String> {
    node().map_err(|why| format!("packages carry the page, which Node builds: {why}"))?;
    if !npm(&["ci", "--no-audit", "--no-fund", "--loglevel=error"]) || !npm(&["run", "--silent", "build"]) {
        return Err("the page cannot be built".to_owned());
    }
    Ok(())
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
