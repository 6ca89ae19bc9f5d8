//! Tables for the docs: Markdown files that say which command, commit, machine and schema made
//! them.

use crate::machine::Machine;
use crate::registry::STUDIES;
use crate::study::Entry;

/// The content of a file: a first line with study, schema and commit, then the command and the
/// machine, then the table.
pub fn page(entry: &dyn Entry, command: &str, commit: &str, body: &str) -> String {
    let (kind, name) = (entry.kind().name(), entry.name());
    format!(
        "<!-- trocar {kind} {name}; schema {}; commit {commit} -->\n\nMeasured by `{command}` at commit \
         {commit}, on {}.\n\n{body}",
        entry.schema(),
        Machine::here().name()
    )
}

/// Checks that the study of `text` exists and that its table still has the same schema.
///
/// # Errors
/// A sentence that says what is wrong.
pub fn check(text: &str) -> Result<(), String> {
    let first = text.lines().next().unwrap_or_default();
    let inner = first.strip_prefix("<!-- trocar ").and_then(|l| l.strip_suffix(" -->"));
    let Some([study, schema, _commit]) =
        inner.and_then(|l| <[&str; 3]>::try_from(l.split("; ").collect::<Vec<_>>()).ok())
    else {
        return Err(format!(
            "the first line is '{first:.80}', without study, schema and commit; run `cargo xtask figures`"
        ));
    };
    let Some(entry) = STUDIES.iter().find(|e| format!("{} {}", e.kind().name(), e.name()) == study) else {
        return Err(format!("there is no study '{study}'; remove the file"));
    };
    let now = format!("schema {}", entry.schema());
    if schema != now {
        return Err(format!(
            "'{study}' writes {now}, the file has {schema}; run `cargo xtask figures {}`",
            entry.name()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_of_its_study_until_the_schema_changes() {
        let entry = STUDIES[0];
        let text = page(entry, "trocar experiment x", "abc1234", "| a |\n");
        assert_eq!(check(&text), Ok(()));
        let other = text.replacen(&format!("schema {}", entry.schema()), "schema 999", 1);
        assert!(check(&other).unwrap_err().contains("cargo xtask figures"));
        assert!(check(&text.replacen(entry.name(), "gone", 1)).unwrap_err().contains("there is no study"));
        assert!(check("| a table by hand |").unwrap_err().contains("first line"));
    }
}
