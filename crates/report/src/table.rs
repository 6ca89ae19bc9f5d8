//! Tables of plain texts, and the format of their numbers.

use crate::page;
use std::fmt::Write;

/// A count with thin spaces between thousands.
pub fn count(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}

/// A number with fixed decimals and a true minus sign; a dash if it is not finite.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("\u{2212}{rest}"),
        None => text,
    }
}

/// A number with fixed decimals; a dash if there is none.
pub fn or_dash(value: Option<f64>, decimals: usize) -> String {
    fixed(value.unwrap_or(f64::NAN), decimals)
}

/// A share as a percentage.
pub fn percent(share: f64, decimals: usize) -> String {
    format!("{}\u{202f}%", fixed(100.0 * share, decimals))
}

/// "yes" or "no".
pub fn yes_or_no(value: bool) -> String {
    if value { "yes" } else { "no" }.to_owned()
}

/// A cell with more characters than this is a sentence. Its column gets room to be read in a table
/// of many columns.
const MAX_SHORT_CELL: usize = 40;

/// An HTML table of plain texts.
pub(crate) fn plain(head: &[String], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, texts: &[String]| {
        let class = |t: &str| if t.chars().count() > MAX_SHORT_CELL { " class=\"long\"" } else { "" };
        texts.iter().map(|t| format!("<{tag}{}>{}</{tag}>", class(t), page::escape(t))).collect::<String>()
    };
    let mut out =
        format!("<div class=\"wide\"><table class=\"plain\"><thead><tr>{}</tr></thead><tbody>\n", cells("th", head));
    for row in rows {
        let _ = writeln!(out, "<tr>{}</tr>", cells("td", row));
    }
    out.push_str("</tbody></table></div>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_get_room() {
        let why = "empty jaws: they closed on nothing at 3.0 s, 1 mm from the appendix".to_owned();
        let html = plain(&["Held".to_owned(), "Remarks".to_owned()], &[vec!["no".to_owned(), why]]);
        assert!(html.contains("<td>no</td><td class=\"long\">empty jaws"), "{html}");
    }

    #[test]
    fn numbers_are_typeset() {
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(999), "999");
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-1.234, 1), "\u{2212}1.2");
        assert_eq!(fixed(f64::NAN, 1), "\u{2013}");
        assert_eq!(percent(0.034, 1), "3.4\u{202f}%");
    }
}
