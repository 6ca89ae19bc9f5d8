//! What every episode's page shows: pictures, plots over time, events, all figures.

use crate::Result;
use crate::recorder::Pictures;
use serde::Serialize;
use trocar_cell::CellEvent;
use trocar_report::page::{self, Columns};
use trocar_report::plots::{Band, Line, Plot};
use trocar_report::table::{self, fixed};
use trocar_report::{colors, figures};
use trocar_task::Channels;

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
    /// The plot of `channels`, before `bands`.
    ///
    /// # Errors
    /// A plot that cannot be drawn.
    pub fn figure(self, channels: &[Channels], bands: Vec<Band>) -> Result<String> {
        let line = |(_, value, color): &Curve<'_>| Line {
            points: channels.iter().map(|c| (c.time_s, value(c))).collect(),
            color: colors::organ(*color),
            filled: false,
        };
        let plot = Plot {
            title: self.title,
            x: "time [s]",
            y: self.y,
            lines: self.curves.iter().map(line).collect(),
            bands,
            show: vec![0.0],
            limits: self.limits,
            log_x: false,
            log_y: false,
        };
        let legend = page::legend(self.curves.iter().map(|(name, _, color)| (*name, colors::organ(*color))));
        Ok(page::figure(&plot.svg()?, &format!("<b>{}</b>: {}{legend}", self.title, self.caption)))
    }
}

/// The section of pictures; nothing without any.
///
/// # Errors
/// A picture that cannot be encoded.
pub(super) fn pictures(pictures: &Pictures) -> Result<String> {
    let mut all = Vec::new();
    if let Some((bytes, size)) = &pictures.film {
        let img = figures::img_of_bytes("webp", bytes, size[0], size[1], "the lift through a camera of the scene");
        all.push(page::figure(&img, "<b>The lift</b> in real time."));
    }
    for (caption, picture) in &pictures.stills {
        all.push(page::figure(&figures::img(picture, caption)?, &format!("<b>{}</b>", page::escape(caption))));
    }
    if all.is_empty() {
        return Ok(String::new());
    }
    let lead = "Direct light; instruments and organs are where the simulation has them.";
    Ok(page::section("What the cameras saw", lead, &page::grid(Columns::Two, &all)))
}

/// The section of events.
pub(super) fn events(events: &[(f64, CellEvent)]) -> String {
    let rows: Vec<Vec<String>> = events.iter().map(|(time, event)| vec![fixed(*time, 2), event.to_string()]).collect();
    let body = if rows.is_empty() { String::new() } else { table::plain(&["Time [s]", "Event"], &rows) };
    let lead = if rows.is_empty() { "The jaws took hold of nothing and cut nothing." } else { "" };
    page::section("What happened", lead, &body)
}

/// The section of every number, word and flag of `result` by its key. What was not measured has a dash.
pub(super) fn all_figures(result: &impl Serialize) -> String {
    let Ok(serde_json::Value::Object(all)) = serde_json::to_value(result) else { return String::new() };
    let simple = all.into_iter().filter(|(_, v)| !v.is_array() && !v.is_object());
    let text = |v: serde_json::Value| match v {
        serde_json::Value::Null => "\u{2013}".to_owned(),
        serde_json::Value::String(text) => text,
        other => other.to_string(),
    };
    let rows: Vec<Vec<String>> = simple.map(|(key, value)| vec![key, text(value)]).collect();
    page::section("All figures of the run", "", &table::plain(&["Figure", "Value"], &rows))
}
