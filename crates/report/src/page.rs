//! Building blocks of an HTML page: frame, style sheet, escaping of texts.

use std::fmt::Write;

/// Escapes text for HTML elements and quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// The colour as `#rrggbb`.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// The whole page. `title` and `subtitle` are plain text, `body` is HTML.
pub fn page(title: &str, subtitle: &str, body: &str) -> String {
    let (title, subtitle) = (escape(title), escape(subtitle));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header><p class=\"mark\">Trocar</p><h1>{title}</h1><p class=\"sub\">{subtitle}</p></header>\n\
         {body}\n<footer>Lengths in millimetres, angles in degrees, SI units otherwise. \
         Written by trocar {version}.</footer>\n</main>\n</body>\n</html>\n",
        version = env!("CARGO_PKG_VERSION"),
    )
}

/// The page, which the browser loads again after so many seconds, or leaves then for `to`, a
/// relative address in plain text.
pub fn refreshed(page: &str, seconds: u32, to: Option<&str>) -> String {
    let to = to.map_or_else(String::new, |to| format!("; url={}", escape(to)));
    page.replacen("<head>\n", &format!("<head>\n<meta http-equiv=\"refresh\" content=\"{seconds}{to}\">\n"), 1)
}

/// A section. `title` is plain text, `lead` and `body` are HTML.
pub fn section(title: &str, lead: &str, body: &str) -> String {
    let lead = if lead.is_empty() { String::new() } else { format!("<p class=\"lead\">{lead}</p>\n") };
    format!("<section>\n<h2>{}</h2>\n{lead}{body}\n</section>\n", escape(title))
}

/// A picture or plot (HTML) above its caption (HTML).
pub fn figure(content: &str, caption: &str) -> String {
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>\n")
}

/// Columns of a grid on a wide screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Columns {
    /// Two.
    Two,
    /// Three.
    Three,
}

/// A grid of figures; one column on a narrow screen.
pub fn grid(columns: Columns, figures: &[String]) -> String {
    let class = match columns {
        Columns::Two => "g2",
        Columns::Three => "g3",
    };
    format!("<div class=\"grid {class}\">\n{}</div>\n", figures.concat())
}

/// One figure of merit (plain texts).
#[derive(Clone, Debug)]
pub struct Card {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: String,
    /// Remark.
    pub note: String,
    /// Whether the value meets its target; none without a target.
    pub met: Option<bool>,
}

impl Card {
    /// A figure without a target.
    pub fn new(name: &'static str, value: impl Into<String>, note: impl Into<String>) -> Self {
        Self { name, value: value.into(), note: note.into(), met: None }
    }

    /// The same with a target that is met or missed.
    #[must_use]
    pub fn met(self, met: bool) -> Self {
        Self { met: Some(met), ..self }
    }
}

/// A row of cards.
pub fn cards(cards: &[Card]) -> String {
    let mut out = String::from("<div class=\"cards\">\n");
    for card in cards {
        let class = match card.met {
            None => "",
            Some(true) => " good",
            Some(false) => " bad",
        };
        let _ = writeln!(
            out,
            "<div class=\"card{class}\"><span class=\"name\">{}</span><span class=\"value\">{}</span>\
             <span class=\"note\">{}</span></div>",
            escape(card.name),
            escape(&card.value),
            escape(&card.note)
        );
    }
    out.push_str("</div>\n");
    out
}

/// A warning (plain text) in red.
pub fn warning(text: &str) -> String {
    format!("<p class=\"warning\"><b>Warning.</b> {}</p>\n", escape(text))
}

/// A legend: names (plain text) and colours.
pub fn legend<'a>(entries: impl IntoIterator<Item = (&'a str, [u8; 3])>) -> String {
    let mut out = String::from("<span class=\"legend\">");
    for (name, color) in entries {
        let _ = write!(out, "<span><i style=\"background:{}\"></i>{}</span>", hex(color), escape(name));
    }
    out.push_str("</span>");
    out
}

/// A colour bar with its end values and its unit (plain texts).
pub fn scale_bar(stops: &[[u8; 3]], low: &str, unit: &str, high: &str) -> String {
    let colors: Vec<String> = stops.iter().map(|c| hex(*c)).collect();
    format!(
        "<span class=\"bar\"><i style=\"background:linear-gradient(to right,{})\"></i>\
         <span><b>{}</b><span>{}</span><b>{}</b></span></span>",
        colors.join(","),
        escape(low),
        escape(unit),
        escape(high)
    )
}

/// A list of plain texts; empty without items.
pub fn list(items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let items: Vec<String> = items.iter().map(|i| format!("<li>{}</li>", escape(i))).collect();
    format!("<ul>{}</ul>\n", items.join(""))
}

/// A part that is folded until the reader opens it. `title` is plain text, `body` is HTML.
pub fn fold(title: &str, body: &str) -> String {
    format!("<details><summary>{}</summary>\n{body}</details>\n", escape(title))
}

/// Names and values (plain texts) in two columns.
pub fn definitions(entries: &[(&str, String)]) -> String {
    let mut out = String::from("<dl>");
    for (name, value) in entries {
        let _ = write!(out, "<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
    }
    out.push_str("</dl>\n");
    out
}

const STYLE: &str = r#":root{--ink:#16202a;--soft:#5b6874;--line:#dde3e8;--paper:#fff;--card:#f5f7f9;--accent:#0b7a75;--good:#1a7f4b;--bad:#b3261e}
@media (prefers-color-scheme:dark){:root{--ink:#e6ebef;--soft:#98a4af;--line:#2c353d;--paper:#12171b;--card:#1a2126;--accent:#4fc4bb;--good:#5fcf94;--bad:#ff8a80}}
*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif;-webkit-text-size-adjust:100%}
main{max-width:1100px;margin:0 auto;padding:40px 24px 56px}
header{border-bottom:2px solid var(--accent);padding-bottom:18px}
.mark{margin:0;color:var(--accent);font-weight:650;letter-spacing:.14em;text-transform:uppercase;font-size:.8rem}
h1{margin:.15em 0 .1em;font-size:2.1rem;line-height:1.2;font-weight:680;letter-spacing:-.015em;overflow-wrap:anywhere}
.sub{margin:0;color:var(--soft)}
section{margin-top:44px}
h2{margin:0 0 6px;font-size:1.3rem;font-weight:650;letter-spacing:-.01em}
.lead{margin:0 0 16px;color:var(--soft);max-width:78ch}
.warning{margin:0 0 16px;max-width:78ch;color:var(--bad);border-left:4px solid var(--bad);padding:2px 0 2px 12px}
.grid{display:grid;gap:22px 20px;margin:0 0 22px}
.g2{grid-template-columns:repeat(2,minmax(0,1fr))}
.g3{grid-template-columns:repeat(3,minmax(0,1fr))}
figure{margin:0;break-inside:avoid}
figure img{display:block;width:100%;height:auto;border-radius:6px}
figure svg{display:block;width:100%;height:auto}
figure svg text{font-family:system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
figcaption{margin-top:8px;font-size:.86rem;line-height:1.42;color:var(--soft)}
figcaption b{color:var(--ink);font-weight:600}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(215px,1fr));gap:12px;margin:0 0 22px}
.card{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:12px 14px;display:flex;flex-direction:column;break-inside:avoid}
.card .name{font-size:.78rem;color:var(--soft)}
.card .value{font-size:1.45rem;font-weight:640;line-height:1.3;font-variant-numeric:tabular-nums;overflow-wrap:anywhere}
.card .note{font-size:.78rem;color:var(--soft)}
.good .value{color:var(--good)}
.bad .value{color:var(--bad)}
.legend{display:flex;flex-wrap:wrap;gap:2px 14px;margin-top:6px}
.legend span{white-space:nowrap;color:var(--ink)}
.legend i{display:inline-block;width:.72em;height:.72em;border-radius:2px;margin-right:.4em}
.bar{display:block;margin-top:6px}
.bar i{display:block;height:9px;border-radius:3px}
.bar>span{display:flex;justify-content:space-between;font-variant-numeric:tabular-nums}
.legend i,.bar i{-webkit-print-color-adjust:exact;print-color-adjust:exact}
.wide{overflow-x:auto;margin:0 0 12px}
table{border-collapse:collapse;width:100%;font-size:.82rem;font-variant-numeric:tabular-nums}
th,td{padding:7px 6px;text-align:right;border-bottom:1px solid var(--line);vertical-align:top;white-space:nowrap}
th{font-weight:600;color:var(--soft);vertical-align:bottom;border-bottom:1.5px solid var(--ink);line-height:1.25;white-space:normal}
th:first-child,td:first-child{text-align:left}
td:first-child{font-weight:600}
td small{display:block;color:var(--soft);font-size:.78rem;font-weight:400}
td i{display:inline-block;width:.72em;height:.72em;border-radius:2px;margin-right:.45em;-webkit-print-color-adjust:exact;print-color-adjust:exact}
tr.sum td{border-bottom:0;border-top:1.5px solid var(--ink)}
td.bad{color:var(--bad);font-weight:640}
.plain th,.plain td{text-align:left;white-space:normal}
.plain td.long{min-width:16rem}
.plain td+td{font-variant-numeric:tabular-nums}
ul{margin:0 0 14px;padding-left:1.2em}
details{margin:0 0 14px}
summary{cursor:pointer;color:var(--accent);margin:0 0 8px}
dl{display:grid;grid-template-columns:max-content 1fr;gap:4px 18px;margin:0;font-size:.9rem}
dt{color:var(--soft)}
dd{margin:0;overflow-wrap:anywhere}
footer{margin-top:48px;padding-top:14px;border-top:1px solid var(--line);font-size:.8rem;color:var(--soft)}
@media (max-width:720px){.g2,.g3{grid-template-columns:1fr}main{padding:24px 16px}}
@media print{:root{--ink:#000;--soft:#444;--line:#ccc;--paper:#fff;--card:#fff;--accent:#0b7a75;--good:#1a7f4b;--bad:#b3261e}main{max-width:none;padding:0}section{margin-top:26px}h2,.lead{break-after:avoid}}
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_cannot_become_markup() {
        assert_eq!(escape("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
        let html = page("<b>", "\"&", &cards(&[Card::new("n", "<i>", "<u>")]));
        assert!(!html.contains("<b>") && !html.contains("<i>") && !html.contains("<u>"));
    }

    #[test]
    fn the_style_sheet_loads_nothing() {
        assert!(!STYLE.contains("url(") && !STYLE.contains("@import"));
    }
}
