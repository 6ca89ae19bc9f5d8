//! Strict TOML: errors name the file, line and field, and a known key that is similar.

use crate::error::{Error, Result};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads a TOML file into `T`. Where `T` denies unknown fields, the error for one suggests a
/// similar known key.
///
/// # Errors
/// Names the file, and the line and field of a mistake in it.
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    parse_toml(&text).map_err(|reason| Error::Invalid { path: path.to_owned(), reason })
}

/// [`read_toml`] for text in memory.
///
/// # Errors
/// One line "line: field: what is wrong", as far as these are known.
pub fn parse_toml<T: DeserializeOwned>(text: &str) -> std::result::Result<T, String> {
    let document: toml::Table = text.parse().map_err(|e: toml::de::Error| {
        let line = e.span().map_or_else(String::new, |s| format!("line {}: ", line_at(text, s.start)));
        format!("{line}{}", one_line(e.message()))
    })?;
    serde_path_to_error::deserialize(toml::Value::Table(document)).map_err(|e| {
        let field = e.path().to_string();
        let (place, line) = match field.as_str() {
            "." | "?" => (String::new(), Some(1)),
            _ => (format!("{field}: "), line_of(text, &field)),
        };
        let line = line.map_or_else(String::new, |n| format!("line {n}: "));
        let message = e.inner().message();
        format!("{line}{place}{}{}", one_line(message), suggestion(message))
    })
}

fn line_at(text: &str, byte: usize) -> usize {
    1 + text.as_bytes()[..byte.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

/// The line, from 1, of the field `path`, such as `organ[1].pins.share`. For a field that is not in
/// the text, the line of its innermost part that is. `None` where there is none, or the text is not
/// TOML.
pub fn line_of(text: &str, path: &str) -> Option<usize> {
    let document = toml::de::DeTable::parse(text).ok()?;
    let mut table = Some(document.get_ref());
    let mut array: Option<&toml::de::DeArray<'_>> = None;
    let mut line = None;
    for step in path.split(['.', '[']) {
        let (value, start) = match (step.strip_suffix(']'), table, array) {
            (Some(index), _, Some(array)) => match index.parse().ok().and_then(|i: usize| array.get(i)) {
                Some(value) => (value, value.span().start),
                None => break,
            },
            (None, Some(table), _) => match table.get_key_value(step) {
                // A key's line is its own; a table's is its header's, because headers below repeat
                // the key.
                Some((key, value)) => {
                    (value, if value.get_ref().is_table() { value.span().start } else { key.span().start })
                }
                None => break,
            },
            _ => break,
        };
        line = Some(line_at(text, start));
        table = value.get_ref().as_table();
        array = value.get_ref().as_array();
    }
    line
}

/// A parser's message on one line. It is cut, because it may repeat a value as long as the file.
fn one_line(message: &str) -> String {
    const MAX_MESSAGE_CHARS: usize = 1000;
    let line = message.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_MESSAGE_CHARS) {
        Some((end, _)) => format!("{} ...", &line[..end]),
        None => line,
    }
}

/// "; did you mean ..." for serde's "unknown field `a`, expected one of `b`, `c`".
fn suggestion(message: &str) -> String {
    if !message.contains("unknown field") && !message.contains("unknown variant") {
        return String::new();
    }
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(given) = quoted.next() else { return String::new() };
    match nearest(given, quoted) {
        Some(known) => format!("; did you mean `{known}`?"),
        None => String::new(),
    }
}

/// Smallest Jaro-Winkler similarity, in [0, 1], of a name that is suggested.
const MIN_SIMILARITY: f64 = 0.8;

/// The name in `known` most similar to `given`; the first of equals. `None` where none is similar.
pub fn nearest<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut best: Option<(f64, &str)> = None;
    for candidate in known {
        let score = strsim::jaro_winkler(given, candidate);
        if score >= MIN_SIMILARITY && best.is_none_or(|(s, _)| score > s) {
            best = Some((score, candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Outer {
        rate_hz: f64,
        inner: Inner,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code)]
    struct Inner {
        width: usize,
        height: usize,
    }

    fn reason(text: &str) -> String {
        parse_toml::<Outer>(text).unwrap_err()
    }

    #[test]
    fn fields_are_found_by_their_paths() {
        let text = "a = 1\n[[b]]\nc = [1,\n  2]\n\n[[b]]\nd = { e = 1 }\n[f.g]\nh = 1\n[f.i]\n";
        let lines = [
            ("a", 1),
            ("b[0].c", 3),
            ("b[0].c[1]", 4),
            ("b[1].d.e", 7),
            ("b[1].absent", 6),
            ("b[7]", 2),
            ("f.g", 8),
            ("f.g.h", 9),
            ("f.i.absent", 10),
        ];
        for (path, line) in lines {
            assert_eq!(line_of(text, path), Some(line), "{path}");
        }
        assert_eq!(line_of(text, "absent.a"), None);
        assert_eq!(line_of("= 1", "a"), None);
    }

    #[test]
    fn only_similar_names_are_suggested() {
        let similar = [
            ("apendix", "appendix"),
            ("lft", "left"),
            ("colour_topic", "color_topic"),
            ("depth_scale", "depth_scale_m"),
            ("phantom-q", "phantom-a"),
        ];
        for (given, known) in similar {
            assert_eq!(nearest(given, ["tube", known]), Some(known));
        }
        for (given, known) in [("appendix", "tube"), ("middle", "right"), ("scissors", "cutter"), ("fps", "rate_hz")] {
            assert_eq!(nearest(given, [known]), None, "{given}");
        }
    }

    #[test]
    fn mistakes_name_the_field_and_the_nearest_key() {
        assert!(parse_toml::<Outer>("rate_hz = 30\n[inner]\nwidth = 1\nheight = 2").is_ok());
        let r = reason("rate_hz = 30\n[inner]\nwidht = 1\nheight = 2");
        assert!(r.contains("line 3") && r.contains("widht") && r.contains("did you mean `width`?"), "{r}");
        let r = reason("ratehz = 30");
        assert!(r.contains("did you mean `rate_hz`?"), "{r}");
        let r = reason("rate_hz = 'x'\n[inner]\nwidth = 1\nheight = 2");
        assert!(r.contains("rate_hz") && r.contains("line 1"), "{r}");
        assert!(reason("rate_hz = 30\n[inner]\nwidth = 1").contains("height"));
        let r = reason("rate_hz = = 3");
        assert!(r.contains("line 1") && !r.contains('\n'), "{r}");
        let r = reason(&format!("rate_hz = '{}'", "long ".repeat(1000)));
        assert!(r.starts_with("line 1: rate_hz: invalid type") && r.ends_with(" ...") && r.len() < 1100, "{r}");
    }
}
