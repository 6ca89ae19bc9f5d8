//! A document: sections with figures of merit, tables, plots and pictures. It is written as an HTML
//! page, as text for a terminal, or as Markdown for the docs.

use crate::Result;
use crate::figures;
use crate::page::{self, Card, Columns};
use crate::plots::Plot;
use crate::table;
use std::fmt::Write;
use trocar_camera::ColorImage;

/// A titled document.
#[derive(Clone, Debug, Default)]
pub struct Document {
    title: String,
    subtitle: String,
    sections: Vec<Section>,
}

/// A section of a document.
#[derive(Clone, Debug, Default)]
pub struct Section {
    title: String,
    lead: String,
    blocks: Vec<Block>,
}

/// A part of a section.
#[derive(Clone, Debug)]
enum Block {
    Cards(Vec<Card>),
    Figures(Columns, Vec<String>),
    Lines(Vec<String>),
    Html(String),
    Table(Table),
}

/// A column of a table: its name, units in round brackets, and its cell of a row.
pub type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> String);

/// A table of plain texts.
#[derive(Clone, Debug, Default)]
pub struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
    only_page: bool,
}

impl Table {
    /// A table with the names of its columns, units in round brackets.
    pub fn new<T: Into<String>>(head: impl IntoIterator<Item = T>, rows: Vec<Vec<String>>) -> Self {
        Self { head: head.into_iter().map(Into::into).collect(), rows, only_page: false }
    }

    /// A table of `rows` by columns.
    pub fn of<T>(rows: impl IntoIterator<Item = T>, columns: &[Column<'_, T>]) -> Self {
        let cells = |row| columns.iter().map(|(_, cell)| cell(&row)).collect();
        Self::new(columns.iter().map(|(name, _)| *name), rows.into_iter().map(cells).collect())
    }

    /// The same table on the page only, for long tables.
    #[must_use]
    pub fn on_page_only(self) -> Self {
        Self { only_page: true, ..self }
    }

    /// The HTML for a page.
    pub fn html(&self) -> String {
        table::plain(&self.head, &self.rows)
    }

    /// Lines for a terminal in aligned columns: the first left, the others right.
    pub fn text(&self) -> String {
        let cells = |row: &[String]| row.iter().map(|c| plain(c)).collect::<Vec<_>>();
        let lines: Vec<Vec<String>> =
            std::iter::once(self.head.as_slice()).chain(self.rows.iter().map(Vec::as_slice)).map(cells).collect();
        let columns = self.head.len();
        let mut widths = vec![0; columns];
        // A shorter row ends in a message, which may be long.
        for line in lines.iter().filter(|line| line.len() == columns) {
            for (width, cell) in widths.iter_mut().zip(line) {
                *width = (*width).max(cell.chars().count());
            }
        }
        let mut out = String::new();
        for line in &lines {
            for (k, (cell, width)) in line.iter().zip(&widths).enumerate() {
                let _ = if k == 0 { write!(out, "  {cell:<width$}") } else { write!(out, "  {cell:>width$}") };
            }
            out.truncate(out.trim_end_matches(' ').len());
            out.push('\n');
        }
        out
    }

    fn markdown(&self) -> String {
        let cell = |c: &String| c.replace('|', "\\|").replace(['\n', '\u{ad}'], " ");
        let line = |row: &[String]| format!("| {} |\n", row.iter().map(cell).collect::<Vec<_>>().join(" | "));
        let rule: Vec<String> = (0..self.head.len()).map(|k| if k == 0 { "---" } else { "--:" }.to_owned()).collect();
        let whole = |row: &Vec<String>| {
            let mut row = row.clone();
            row.resize(self.head.len(), String::new());
            line(&row)
        };
        line(&self.head) + &line(&rule) + &self.rows.iter().map(whole).collect::<String>()
    }
}

impl Section {
    /// A section with its title (plain text) and lead (HTML, may be empty).
    pub fn new(title: impl Into<String>, lead: impl Into<String>) -> Self {
        Self { title: title.into(), lead: lead.into(), blocks: Vec::new() }
    }

    /// Figures of merit.
    #[must_use]
    pub fn cards(mut self, cards: impl IntoIterator<Item = Card>) -> Self {
        self.blocks.push(Block::Cards(cards.into_iter().collect()));
        self
    }

    /// A table.
    #[must_use]
    pub fn table(mut self, table: Table) -> Self {
        self.blocks.push(Block::Table(table));
        self
    }

    /// Sentences (plain text): a list on the page, lines in the terminal.
    #[must_use]
    pub fn lines(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        let lines: Vec<String> = lines.into_iter().collect();
        if !lines.is_empty() {
            self.blocks.push(Block::Lines(lines));
        }
        self
    }

    /// A plot above its caption (HTML). Consecutive plots and pictures share a grid of two columns.
    ///
    /// # Errors
    /// A plot that cannot be drawn.
    pub fn plot(self, plot: &Plot<'_>, caption: &str) -> Result<Self> {
        Ok(self.figure(Columns::Two, plot.figure(caption)?))
    }

    /// A picture above its caption (HTML); `alt` is its description (plain text).
    ///
    /// # Errors
    /// A picture whose number of pixels differs from its size.
    pub fn picture(self, picture: &ColorImage, alt: &str, caption: &str) -> Result<Self> {
        Ok(self.figure(Columns::Two, figures::figure(picture, alt, caption)?))
    }

    /// A figure (HTML) in a grid of `columns`.
    #[must_use]
    pub fn figure(mut self, columns: Columns, figure: String) -> Self {
        match self.blocks.last_mut() {
            Some(Block::Figures(same, figures)) if *same == columns => figures.push(figure),
            _ => self.blocks.push(Block::Figures(columns, vec![figure])),
        }
        self
    }

    /// Figures (HTML) in a grid of two columns.
    #[must_use]
    pub fn figures(self, figures: impl IntoIterator<Item = String>) -> Self {
        figures.into_iter().fold(self, |section, figure| section.figure(Columns::Two, figure))
    }

    /// HTML on the page only.
    #[must_use]
    pub fn html(mut self, html: impl Into<String>) -> Self {
        self.blocks.push(Block::Html(html.into()));
        self
    }

    fn page(&self) -> String {
        let block = |block: &Block| match block {
            Block::Cards(cards) => page::cards(cards),
            Block::Figures(columns, figures) => page::grid(*columns, figures),
            Block::Lines(lines) => page::list(lines),
            Block::Html(html) => html.clone(),
            Block::Table(table) => table.html(),
        };
        page::section(&self.title, &self.lead, &self.blocks.iter().map(block).collect::<String>())
    }
}

impl Document {
    /// An empty document with its title and subtitle (plain text).
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), sections: Vec::new() }
    }

    /// Adds a section.
    #[must_use]
    pub fn with(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The HTML page.
    pub fn page(&self) -> String {
        page::page(&self.title, &self.subtitle, &self.sections.iter().map(Section::page).collect::<String>())
    }

    /// The text for a terminal: tables, figures of merit and sentences.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for block in self.sections.iter().flat_map(|s| &s.blocks) {
            match block {
                Block::Cards(cards) => {
                    for card in cards {
                        let missed = if card.met == Some(false) { " (target missed)" } else { "" };
                        let line = format!("{}: {}{missed}; {}", card.name, card.value, card.note);
                        let _ = writeln!(out, "{}", plain(line.trim_end_matches("; ")));
                    }
                }
                Block::Lines(lines) => lines.iter().for_each(|line| {
                    let _ = writeln!(out, "{}", plain(line));
                }),
                Block::Table(table) if !table.only_page => out.push_str(&table.text()),
                Block::Table(_) | Block::Figures(..) | Block::Html(_) => {}
            }
        }
        out
    }

    /// The Markdown for the docs: sections with a table or figures of merit, without plots and
    /// pictures.
    pub fn markdown(&self) -> String {
        let mut out = String::new();
        for section in &self.sections {
            let mut body = String::new();
            for block in &section.blocks {
                match block {
                    Block::Cards(cards) => {
                        for card in cards {
                            let note = if card.note.is_empty() { String::new() } else { format!(" ({})", card.note) };
                            let _ = writeln!(body, "- {}: {}{note}", card.name, card.value);
                        }
                        body.push('\n');
                    }
                    Block::Lines(lines) => {
                        lines.iter().for_each(|line| {
                            let _ = writeln!(body, "- {line}");
                        });
                        body.push('\n');
                    }
                    Block::Table(table) if !table.only_page => {
                        body.push_str(&table.markdown());
                        body.push('\n');
                    }
                    Block::Table(_) | Block::Figures(..) | Block::Html(_) => {}
                }
            }
            if !body.is_empty() {
                let _ = write!(out, "**{}**\n\n{body}", section.title);
            }
        }
        out
    }
}

/// Replaces typographic characters by ASCII, for terminals and for programs that read the output.
fn plain(text: &str) -> String {
    text.replace(['\u{202f}', '\u{a0}'], " ")
        .replace(['\u{2212}', '\u{2013}'], "-")
        .replace('\u{2019}', "'")
        .replace('\u{ad}', "")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made_up() -> Document {
        let table = Table::new(
            ["Organ", "Error (mm)"],
            vec![vec!["liver".into(), "\u{2212}0.12".into()], vec!["a|b".into(), "1\u{202f}000".into()]],
        );
        let long = Table::new(["only the page"], vec![vec!["has this".into()]]).on_page_only();
        Document::new("Errors <1>", "made up").with(
            Section::new("Together", "<i>All</i> of it.")
                .cards([Card::new("Worst", "0.12 mm", "of two").met(true)])
                .table(table)
                .table(long)
                .lines(["found & kept".to_owned()]),
        )
    }

    #[test]
    fn the_page_escapes_text_and_keeps_html() {
        let page = made_up().page();
        assert!(page.contains("Errors &lt;1&gt;") && page.contains("<i>All</i>") && page.contains("found &amp; kept"));
        assert!(page.contains("has this") && page.contains("card good"));
    }

    #[test]
    fn the_terminal_has_aligned_plain_text() {
        let text = made_up().text();
        assert_eq!(
            text,
            "Worst: 0.12 mm; of two\n  Organ  Error (mm)\n  liver       -0.12\n  a|b         1 000\nfound & kept\n"
        );
    }

    #[test]
    fn markdown_has_tables_and_figures_of_merit() {
        let markdown = made_up().markdown();
        assert!(markdown.starts_with("**Together**\n\n- Worst: 0.12 mm (of two)\n"));
        assert!(markdown.contains("| Organ | Error (mm) |\n| --- | --: |\n| liver | \u{2212}0.12 |\n| a\\|b |"));
        assert!(!markdown.contains("has this"));
    }
}
