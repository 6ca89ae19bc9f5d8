//! Sections of lifts and episodes: pictures, plots over time, events, and all figures.

use crate::Result;
use crate::recorder::Pictures;
use serde::Serialize;
use trocar_cell::CellEvent;
use trocar_report::document::Table;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Band, Line, Plot};
use trocar_report::table::fixed;
use trocar_report::{colors, figures};
use trocar_task::{ArmSummary, Channels, Summary};

/// A curve: its name, its value in a row, and the number of its colour.
pub(super) type Curve<'a> = (&'a str, &'a dyn Fn(&Channels) -> f64, usize);

/// A plot of channels over time.
pub(super) struct TimePlot<'a> {
    pub title: &'a str,
    /// Label of the y axis, with its unit.
    pub y: &'a str,
    pub curves: &'a [Curve<'a>],
    pub caption: &'a str,
    /// Dashed lines.
    pub limits: Vec<f64>,
}

impl TimePlot<'_> {
    /// The plot of `channels` over `bands`.
    pub fn figure(self, channels: &[Channels], bands: Vec<Band>) -> Result<String> {
        let line = |(_, value, color): &Curve<'_>| {
            Line::new(channels.iter().map(|c| (c.time_s, value(c))).collect(), colors::organ(*color))
        };
        let plot = Plot {
            title: self.title,
            x: "time (s)",
            y: self.y,
            lines: self.curves.iter().map(line).collect(),
            bands,
            show: vec![0.0],
            limits: self.limits,
            ..Plot::default()
        };
        let legend = page::legend(self.curves.iter().map(|(name, _, color)| (*name, colors::organ(*color))));
        Ok(plot.figure(&format!("<b>{}</b>: {}{legend}", self.title, self.caption))?)
    }
}

/// The maximum of `of` over the arms.
pub(super) fn peak(s: &Summary, of: fn(&ArmSummary) -> f64) -> f64 {
    s.arms.iter().map(of).fold(0.0, f64::max)
}

/// The card with the number of inverted elements.
pub(super) fn inverted_card(s: &Summary) -> Card {
    Card::new("Inverted elements", s.inverted_peak.to_string(), "maximum of any frame").met(s.inverted_peak == 0)
}

/// The card with the warnings about tissue beyond its limits.
pub(super) fn warnings_card(s: &Summary) -> Card {
    let note = s.warnings.described().unwrap_or_else(|| "nothing was beyond what tissue withstands".to_owned());
    Card::new("Warnings", s.warnings.total().to_string(), note).met(s.warnings.is_empty())
}

/// The section of pictures; empty without pictures.
pub(super) fn pictures(pictures: &Pictures) -> Result<String> {
    let mut all = Vec::new();
    if let Some((bytes, size)) = &pictures.video {
        let img = figures::img_of_bytes("webp", bytes, size[0], size[1], "the lift through a camera of the scene");
        all.push(page::figure(&img, "<b>The lift</b> in real time."));
    }
    for (caption, picture) in &pictures.stills {
        all.push(figures::figure(picture, caption, &format!("<b>{}</b>", page::escape(caption)))?);
    }
    if all.is_empty() {
        return Ok(String::new());
    }
    let lead = "Pictures with direct light of the simulated instruments and organs.";
    Ok(page::section("Camera pictures", lead, &page::grid(Columns::Two, &all)))
}

/// The section of events.
pub(super) fn events(events: &[(f64, CellEvent)]) -> String {
    let rows: Vec<Vec<String>> = events.iter().map(|(time, event)| vec![fixed(*time, 2), event.to_string()]).collect();
    if rows.is_empty() {
        return page::section("Events", "None: no grasp and no cut.", "");
    }
    page::section("Events", "", &Table::new(["Time (s)", "Event"], rows).html())
}

/// The section of all numbers, texts and flags of `result` by key. Figures that were not measured
/// have a dash.
pub(super) fn all_figures(result: &impl Serialize) -> String {
    let Ok(serde_json::Value::Object(all)) = serde_json::to_value(result) else { return String::new() };
    let simple = all.into_iter().filter(|(_, v)| !v.is_array() && !v.is_object());
    let text = |v: serde_json::Value| match v {
        serde_json::Value::Null => "\u{2013}".to_owned(),
        serde_json::Value::String(text) => text,
        other => other.to_string(),
    };
    let row = |(key, value): (String, serde_json::Value)| vec![key, text(value)];
    let rows: Vec<Vec<String>> = simple.map(row).collect();
    page::section("All figures", "", &Table::new(["Figure", "Value"], rows).html())
}
