//! Lines of prose end at column 100: comments of Rust, and Markdown. Tables, code, pictures, links
//! on lines of their own and single words (addresses) may be longer.

use std::path::{Path, PathBuf};

/// The last column of prose.
const LAST: usize = 100;
/// Folders that are searched.
const FOLDERS: [&str; 4] = ["crates", "docs", "examples", "xtask"];
/// Pages in the root.
const PAGES: [&str; 4] = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md"];

/// Names every line of prose that is too long.
///
/// # Errors
/// The list of them; a file that cannot be read.
pub(crate) fn check() -> Result<(), String> {
    let mut files: Vec<PathBuf> = PAGES.iter().map(PathBuf::from).collect();
    for folder in FOLDERS {
        collect(Path::new(folder), &mut files)?;
    }
    files.sort();
    let mut long = Vec::new();
    for file in &files {
        let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
        let markdown = file.extension().is_some_and(|e| e == "md");
        long.extend(too_long(&text, markdown).into_iter().map(|line| format!("{}:{line}", file.display())));
    }
    if long.is_empty() {
        return Ok(());
    }
    Err(format!("{}\n{} lines of prose end beyond column {LAST}", long.join("\n"), long.len()))
}

/// Rust and Markdown files under `folder`. Tables that studies write are theirs.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", folder.display());
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            if !path.ends_with("docs/generated") && !path.ends_with("node_modules") && !path.ends_with("target") {
                collect(&path, files)?;
            }
        } else if path.extension().is_some_and(|e| e == "rs" || e == "md") {
            files.push(path);
        }
    }
    Ok(())
}

/// Numbers of the lines of prose beyond the last column, from 1.
fn too_long(text: &str, markdown: bool) -> Vec<usize> {
    let mut code = false;
    let mut long = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let start = line.trim_start();
        let prose = if markdown {
            start
        } else {
            match ["//!", "///", "//"].iter().find_map(|marker| start.strip_prefix(marker)) {
                Some(comment) => comment.trim_start(),
                None => {
                    code = false;
                    continue;
                }
            }
        };
        if prose.starts_with("```") {
            code = !code;
        }
        let link = prose.trim_start_matches("- ").starts_with(['!', '[']) && prose.ends_with(')');
        let words = prose.split_whitespace().filter(|word| !matches!(*word, "-" | "*")).count();
        if line.chars().count() > LAST && !code && !link && !prose.starts_with('|') && words > 1 {
            long.push(number + 1);
        }
    }
    long
}

#[cfg(test)]
mod tests {
    use super::too_long;

    #[test]
    fn prose_ends_at_the_last_column_and_tables_and_code_need_not() {
        let words = "word ".repeat(25);
        assert_eq!(too_long(&format!("short\n{words}\n| {words}|\n"), true), [2]);
        assert_eq!(too_long(&format!("```\n{words}\n```\n{words}"), true), [4]);
        assert_eq!(too_long(&format!("let a = 1; {words}\n    /// {words}\n"), false), [2]);
        assert_eq!(too_long(&format!("- [{words}](page.md)\n![{words}](picture.png)"), true), [0; 0]);
        assert_eq!(too_long(&format!("https://{}", "a".repeat(120)), true), [0; 0]);
    }
}
