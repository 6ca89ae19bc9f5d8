//! TOML files whose mistakes are explained: file, line, field, and the key that was probably meant.

use crate::{Error, Result};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads a TOML file into `T`. Where `T` denies unknown fields, the error for one names the nearest known key.
///
/// # Errors
/// Names the file, and for a mistake in it the line and the field.
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    parse_toml(&text).map_err(|reason| Error::Invalid { path: path.to_owned(), reason })
}

fn parse_toml<T: DeserializeOwned>(text: &str) -> std::result::Result<T, String> {
    let line = |e: &toml::de::Error| match e.span() {
        Some(span) => {
            let before = &text.as_bytes()[..span.start.min(text.len())];
            format!("line {}: ", 1 + before.iter().filter(|b| **b == b'\n').count())
        }
        None => String::new(),
    };
    let document = toml::Deserializer::parse(text).map_err(|e| format!("{}{}", line(&e), one_line(e.message())))?;
    serde_path_to_error::deserialize(document).map_err(|e| {
        let field = e.path().to_string();
        let inner = e.inner();
        let place = if field == "." || field == "?" { String::new() } else { format!("{field}: ") };
        format!("{}{place}{}{}", line(inner), one_line(inner.message()), suggestion(inner.message()))
    })
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
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

/// The one of `known` most like `given`; the first of equals. `None` without any.
pub fn nearest<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut best: Option<(f64, &str)> = None;
    for candidate in known {
        let score = strsim::jaro_winkler(given, candidate);
        if best.is_none_or(|(s, _)| score > s) {
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
    }
}
