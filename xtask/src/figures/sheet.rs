//! A sheet: figures of a report's page side by side, as one SVG file for the docs. The page's
//! colours become those of paper, and captions and legends become text of the drawing.

use std::fmt::Write;

/// Width of a figure (px), and the space around it.
const WIDTH: f64 = 560.0;
const SPACE: f64 = 16.0;
/// Height of a line of text (px), and how many of its letters are as wide as a figure.
const LINE: f64 = 18.0;
const LETTERS: usize = 88;
/// Width of a letter in a legend (px).
const LETTER: f64 = 6.6;

/// A figure of a page.
struct Figure<'a> {
    /// The plot or picture, without its outermost tag.
    content: Content<'a>,
    /// Height over width.
    aspect: f64,
    /// Lines of the caption.
    caption: Vec<String>,
    /// Names and colours.
    legend: Vec<(String, &'a str)>,
}

enum Content<'a> {
    /// The view box and the inside of an `<svg>`.
    Plot(&'a str, &'a str),
    /// The address of an `<img>`, which holds its data.
    Picture(&'a str),
}

/// The sheet of the figures of `page` whose names begin with one of `names`, in rows of `columns`;
/// without captions if there is one column. The name of a figure is its description for screen
/// readers.
pub fn sheet(page: &str, names: &[&str], columns: usize) -> Result<String, String> {
    let all = page.split("<figure>").skip(1);
    let named = all.filter(|html| names.iter().any(|name| described(html).starts_with(name)));
    let figures: Vec<Figure<'_>> = named.filter_map(|html| figure(html, columns > 1)).collect();
    if figures.is_empty() {
        return Err(format!("the page has no figure named '{}'", names.join("' or '")));
    }
    let space = if columns > 1 { SPACE } else { 0.0 };
    let (mut body, mut top) = (String::new(), space);
    for row in figures.chunks(columns) {
        for (k, figure) in row.iter().enumerate() {
            figure.draw(k as f64 * (WIDTH + space) + space, top, &mut body);
        }
        top += row.iter().map(Figure::height).fold(0.0, f64::max) + space;
    }
    let wide = columns.min(figures.len()) as f64 * (WIDTH + space) + space;
    let ground =
        if columns > 1 { format!("<rect width=\"{wide}\" height=\"{top}\" fill=\"#fff\"/>\n") } else { String::new() };
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {wide} {top}\" width=\"{wide}\" height=\"{top}\" \
         font-family=\"sans-serif\">\n{ground}{body}</svg>\n"
    ))
}

impl Figure<'_> {
    fn height(&self) -> f64 {
        WIDTH * self.aspect + LINE * (self.caption.len() + self.legend_lines().len()) as f64
    }

    /// The legend, divided into lines that are no wider than the figure.
    fn legend_lines(&self) -> Vec<Vec<(f64, &str, &str)>> {
        let mut lines: Vec<Vec<(f64, &str, &str)>> = Vec::new();
        let mut x = WIDTH;
        for (name, color) in &self.legend {
            let wide = 28.0 + LETTER * name.chars().count() as f64;
            if x + wide > WIDTH {
                lines.push(Vec::new());
                x = 0.0;
            }
            if let Some(line) = lines.last_mut() {
                line.push((x, name, color));
            }
            x += wide;
        }
        lines
    }

    fn draw(&self, left: f64, top: f64, out: &mut String) {
        let height = WIDTH * self.aspect;
        let _ = match self.content {
            Content::Plot(view, inside) => writeln!(
                out,
                "<svg x=\"{left}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{height:.1}\" viewBox=\"{view}\">{}</svg>",
                inside.replace("currentColor", "#222")
            ),
            Content::Picture(data) => writeln!(
                out,
                "<image x=\"{left}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{height:.1}\" href=\"{data}\"/>"
            ),
        };
        let mut y = top + height;
        for line in &self.caption {
            y += LINE;
            let _ =
                writeln!(out, "<text x=\"{left}\" y=\"{:.1}\" font-size=\"13\" fill=\"#222\">{line}</text>", y - 4.0);
        }
        for line in self.legend_lines() {
            y += LINE;
            for (x, name, color) in line {
                let (x, base) = (left + x, y - 4.0);
                let _ = writeln!(
                    out,
                    "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"10\" height=\"10\" fill=\"{color}\"/>\
                     <text x=\"{:.1}\" y=\"{base:.1}\" font-size=\"12\" fill=\"#222\">{name}</text>",
                    base - 9.5,
                    x + 15.0
                );
            }
        }
    }
}

/// The description of the figure that begins at the start of `html`.
fn described(html: &str) -> &str {
    let tag = html.split('>').next().unwrap_or_default();
    let value = |name: &str| tag.split_once(name).and_then(|(_, rest)| rest.split('"').next());
    value("aria-label=\"").or_else(|| value("alt=\"")).unwrap_or_default()
}

/// The figure that begins at the start of `html`.
fn figure(html: &str, with_caption: bool) -> Option<Figure<'_>> {
    let html = html.split("</figure>").next()?;
    let (content, aspect) = if let Some(plot) = html.strip_prefix("<svg viewBox=\"") {
        let (view, rest) = plot.split_once('"')?;
        let inside = rest.split_once('>')?.1.split("</svg>").next()?;
        let sizes: Vec<f64> = view.split(' ').filter_map(|n| n.parse().ok()).collect();
        (Content::Plot(view, inside), sizes.get(3)? / sizes.get(2)?)
    } else {
        let value = |name: &str| html.split(&format!(" {name}=\"")).nth(1)?.split('"').next();
        let size = |name: &str| value(name)?.parse::<f64>().ok();
        (Content::Picture(html.strip_prefix("<img src=\"")?.split('"').next()?), size("height")? / size("width")?)
    };
    let caption = html.split_once("<figcaption>").map_or("", |(_, rest)| rest.trim_end_matches("</figcaption>"));
    let (caption, legend) = caption.split_once("<span class=\"legend\">").unwrap_or((caption, ""));
    let legend = legend.split("<i style=\"background:").skip(1).filter_map(|entry| {
        let (color, rest) = entry.split_once("\"></i>")?;
        Some((rest.split("</span>").next()?.to_owned(), color))
    });
    let shown = if with_caption { caption } else { "" };
    Some(Figure {
        content,
        aspect,
        caption: lines(&without_tags(shown)),
        legend: legend.filter(|_| with_caption).collect(),
    })
}

/// The text of some HTML; entities stay as they are.
fn without_tags(html: &str) -> String {
    html.split('<')
        .enumerate()
        .map(|(k, part)| if k == 0 { part } else { part.split_once('>').map_or("", |p| p.1) })
        .collect()
}

/// The words of a text, divided into lines.
fn lines(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= LETTERS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "<div><figure><svg viewBox=\"0 0 560 300\" role=\"img\" aria-label=\"Sag\"><text \
        fill=\"currentColor\">mm</text></svg><figcaption><b>Sag</b>, of &lt;all&gt;.<span class=\"legend\"><span><i \
        style=\"background:#e69614\"></i>quadratic, 0.3</span></span></figcaption></figure>\n<figure><img \
        src=\"data:image/png;base64,AAAA\" width=\"400\" height=\"100\" alt=\"the real one\"><figcaption><b>Real.</b></figcaption>\
        </figure></div>";

    #[test]
    fn a_sheet_has_plots_with_their_captions_and_legends() {
        let svg = sheet(PAGE, &["Sag", "the real"], 2).unwrap();
        assert!(svg.contains("<text fill=\"#222\">mm</text>") && !svg.contains("currentColor"));
        assert!(svg.contains(">Sag, of &lt;all&gt;.</text>") && svg.contains("fill=\"#e69614\""));
        assert!(svg.contains(">quadratic, 0.3</text>") && svg.contains("href=\"data:image/png;base64,AAAA\""));
        // Two figures of 560 px with a space of 16 px around each.
        assert!(svg.contains("viewBox=\"0 0 1168 368\""), "{svg:.200}");
    }

    #[test]
    fn one_column_is_the_picture_alone() {
        let svg = sheet(PAGE, &["the real"], 1).unwrap();
        assert!(svg.contains("viewBox=\"0 0 560 140\"") && !svg.contains("<text"));
        assert!(sheet(PAGE, &["Lift"], 1).unwrap_err().contains("no figure named 'Lift'"));
    }

    #[test]
    fn long_captions_and_legends_are_divided_into_lines() {
        assert_eq!(lines(&"word ".repeat(40)).len(), 3);
        let legend = (0..12).map(|k| (format!("a long name {k}"), "#000")).collect();
        let figure = Figure { content: Content::Picture(""), aspect: 0.5, caption: Vec::new(), legend };
        assert!(figure.legend_lines().iter().all(|line| line.iter().all(|(x, ..)| *x < WIDTH)));
        assert_eq!(figure.height(), 280.0 + 3.0 * LINE);
    }
}
