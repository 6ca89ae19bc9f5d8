//! The generated tables: each is written by its study, with command, commit, machine and schema.

use super::{Trocar, WORK, read};
use std::path::{Path, PathBuf};

/// Where the tables are.
pub const FOLDER: &str = "docs/generated";

/// The names of the tables that are there and that a study writes.
pub fn names() -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(FOLDER).map_err(|e| format!("{FOLDER}: {e}; name a study"))?;
    let files = entries.filter_map(|e| e.ok().map(|e| e.path())).filter(|p| p.extension().is_some_and(|e| e == "md"));
    let names = files.filter_map(|p: PathBuf| p.file_stem().map(|s| s.to_string_lossy().into_owned()));
    let mut names: Vec<String> = names.filter(|name| name != super::LEARNING).collect();
    names.sort();
    Ok(names)
}

/// Runs the study of a table and writes the table.
pub fn run(trocar: &Trocar, name: &str) -> Result<(), String> {
    std::fs::create_dir_all(FOLDER).map_err(|e| format!("{FOLDER}: {e}"))?;
    let file = Path::new(FOLDER).join(format!("{name}.md"));
    let mut words = words(trocar, name, &file)?;
    let help: Vec<&str> = words.iter().take(2).map(String::as_str).chain(["--help"]).collect();
    if trocar.output(&help).is_some_and(|help| help.contains("--output")) {
        words.extend(["--output".to_owned(), format!("{WORK}/{name}")]);
    }
    words.extend(["--docs".to_owned(), file.display().to_string()]);
    trocar.run(&words.iter().map(String::as_str).collect::<Vec<_>>())
}

/// The command of a table: the one that its file names, or the study of this name with its
/// defaults.
fn words(trocar: &Trocar, name: &str, file: &Path) -> Result<Vec<String>, String> {
    if let Some(words) = read(file).ok().and_then(|text| command_of(&text)) {
        return Ok(words);
    }
    let known = ["experiment", "bench"].into_iter().find(|kind| trocar.output(&[kind, name, "--help"]).is_some());
    known.map(|kind| vec![kind.to_owned(), name.to_owned()]).ok_or_else(|| format!("there is no study '{name}'"))
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
