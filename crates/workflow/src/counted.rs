//! Counts with their nouns.

/// `1 frame`, `2 frames`: a count with its noun, which has a regular plural.
///
/// ```
/// assert_eq!(trocar_workflow::counted(1, "episode"), "1 episode");
/// assert_eq!(trocar_workflow::counted(0, "policy"), "0 policies");
/// ```
pub fn counted(count: usize, noun: &str) -> String {
    if count == 1 {
        return format!("1 {noun}");
    }
    match noun.strip_suffix('y') {
        Some(stem) => format!("{count} {stem}ies"),
        None => format!("{count} {noun}s"),
    }
}
