//! The generated tables of the docs: each is written by its study, with command, commit and schema.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where the tables are.
const FOLDER: &str = "docs/generated";

/// Runs the studies named, or all that have a table, and writes their tables.
pub fn run(names: &[&str]) -> Result<(), String> {
    if !crate::cargo(&["build", "--release", "--locked", "-p", "trocar-cli"], &[]) {
        return Err("trocar cannot be built".to_owned());
    }
    let program = std::path::absolute("target/release/trocar").map_err(|e| format!("target/release/trocar: {e}"))?;
    let names = if names.is_empty() { tables()? } else { names.iter().map(|n| (*n).to_owned()).collect() };
    std::fs::create_dir_all(FOLDER).map_err(|e| format!("{FOLDER}: {e}"))?;
    for name in names {
        let file = Path::new(FOLDER).join(format!("{name}.md"));
        let words = words(&program, &name, &file)?;
        eprintln!("== trocar {}", words.join(" "));
        let mut command = Command::new(&program);
        let status = command.args(&words).arg("--docs").arg(&file).stdout(Stdio::null()).status();
        if !status.is_ok_and(|s| s.success()) {
            return Err(format!("{name} failed"));
        }
    }
    Ok(())
}

/// The names of the tables that are there.
fn tables() -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(FOLDER).map_err(|e| format!("{FOLDER}: {e}; name a study"))?;
    let files = entries.filter_map(|e| e.ok().map(|e| e.path())).filter(|p| p.extension().is_some_and(|e| e == "md"));
    let mut names: Vec<String> =
        files.filter_map(|p: PathBuf| p.file_stem().map(|s| s.to_string_lossy().into_owned())).collect();
    names.sort();
    Ok(names)
}

/// The command of a table: the one that its file names, or the study of this name with its
/// defaults.
fn words(program: &Path, name: &str, file: &Path) -> Result<Vec<String>, String> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    if let Some(words) = command_of(&text) {
        return Ok(words);
    }
    for kind in ["experiment", "bench"] {
        let help =
            Command::new(program).args([kind, name, "--help"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
        if help.is_ok_and(|s| s.success()) {
            return Ok(vec![kind.to_owned(), name.to_owned()]);
        }
    }
    Err(format!("there is no study '{name}'"))
}

/// The words of the command in a table's third line, without the program's name.
fn command_of(text: &str) -> Option<Vec<String>> {
    let line = text.lines().find_map(|l| l.strip_prefix("Measured by `trocar "))?;
    Some(line.split('`').next()?.split_whitespace().map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_names_its_command() {
        let text = "<!-- trocar bench organs; schema 1; commit abc -->\n\nMeasured by `trocar bench organs --tets 5` at commit abc.\n";
        assert_eq!(command_of(text).unwrap(), ["bench", "organs", "--tets", "5"]);
        assert_eq!(command_of("by hand"), None);
    }
}
