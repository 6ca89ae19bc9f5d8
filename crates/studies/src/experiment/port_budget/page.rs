//! The page of the port budget.

use super::result::{PortBudgetResult, PortBudgetRow, PortStart, SHEETS};
use crate::Result;
use std::fmt::Write;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, or_dash};

/// The tables show every fifth row; the JSON has all.
const EVERY: usize = 5;

pub(super) fn document(r: &PortBudgetResult) -> Result<Document> {
    let lead = format!(
        "A {} mm shaft in a {} mm hole of a sheet of {} mm. Formula: (D \u{2212} d/cos \u{2212} t tan)/2, the \
         paper\u{2019}s for t = 0. Measured: a shaft pushed sideways in the contact model until it touches the rim.",
        r.shaft_mm, r.hole_mm, r.thickness_mm
    );
    let section =
        Section::new("Port budget", lead).cards(cards(r)).figures([clearance(r)?, sections(r), around(r)?, loaded(r)?]);
    let subtitle = "Lateral clearance of a shaft in its port";
    Ok(Document::new("Port budget", subtitle).with(section).with(starts(r)).with(rows(r)))
}

fn cards(r: &PortBudgetResult) -> Vec<Card> {
    let degrees = |v: Option<f64>| v.map_or("none".to_owned(), |v| format!("{}\u{b0}", fixed(v, 2)));
    let start = |s: &PortStart| {
        let name = if s.arm == "left" { "Left arm's start" } else { "Right arm's start" };
        let near = s.measured_mm.is_some_and(|m| (m - s.paper_mm).abs() < 0.005);
        let note = format!("at {}\u{b0}, measured; paper {} mm", s.tilt_deg, fixed(s.paper_mm, 2));
        Card::new(name, format!("{} mm", fixed(s.measured_mm.unwrap_or(f64::NAN), 3)), note).met(near)
    };
    let mut all: Vec<Card> = r.starts.iter().map(start).collect();
    let note = format!("formula {}; paper about {}\u{b0}", degrees(r.limit_deg), r.paper_limit_deg);
    all.push(Card::new("Tilt without clearance", degrees(r.measured_limit_deg), note));
    let worst = format!("{:.0e} mm", r.largest_difference_mm);
    all.push(Card::new("Formula and contact model", worst, "largest difference, in the direction of the tilt"));
    all
}

fn start_color(k: usize) -> [u8; 3] {
    colors::organ([0, 3][k % 2])
}

fn clearance(r: &PortBudgetResult) -> Result<String> {
    let (formula, measured) = (colors::organ(1), colors::organ(4));
    let thick = |k: usize| colors::organ([2, 7][k % 2]);
    let mut lines: Vec<Line> = (0..SHEETS.len())
        .rev()
        .map(|k| {
            let points = r.rows.iter().map(|row| (row.tilt_deg, row.thicker_mm[k]));
            Line::new(points.filter(|p| p.1 > -0.15).collect(), thick(k))
        })
        .collect();
    let points = r.rows.iter().map(|row| (row.tilt_deg, row.clearance_mm)).collect();
    lines.push(Line::new(points, formula));
    // A measured value is a short line, because plots have no markers.
    for row in r.rows.iter().step_by(EVERY) {
        let points = row.measured_mm.map(|m| vec![(row.tilt_deg - 0.25, m), (row.tilt_deg + 0.25, m)]);
        lines.extend(points.map(|points| Line::new(points, measured)));
    }
    for (k, s) in r.starts.iter().enumerate() {
        let points = vec![(s.tilt_deg, 0.0), (s.tilt_deg, s.clearance_mm), (0.0, s.clearance_mm)];
        lines.push(Line::new(points, start_color(k)));
    }
    let plot = Plot {
        title: "Lateral clearance over tilt",
        x: "tilt (\u{b0})",
        y: "clearance (mm)",
        lines,
        limits: vec![0.0],
        ..Plot::default()
    };
    let sheet = format!("formula, {} mm sheet", r.thickness_mm);
    let thicker = SHEETS.map(|mm| format!("{mm} mm sheet"));
    let starts: Vec<String> = r.starts.iter().map(|s| format!("{} start, {}\u{b0}", s.arm, s.tilt_deg)).collect();
    let entries = [(sheet.as_str(), formula), ("measured (dashes)", measured)]
        .into_iter()
        .chain(thicker.iter().enumerate().map(|(k, t)| (t.as_str(), thick(k))))
        .chain(starts.iter().enumerate().map(|(k, s)| (s.as_str(), start_color(k))));
    let caption = format!("<b>Lateral clearance</b> in the direction of the tilt.{}", page::legend(entries));
    Ok(plot.figure(&caption)?)
}

/// The elliptic section of the shaft in the plane of the hole, pushed in the direction of the tilt
/// until it touches.
fn sections(r: &PortBudgetResult) -> String {
    let hole = 0.5 * r.hole_mm;
    let step = 2.5 * hole;
    let shown: Vec<_> = r.rooms.iter().filter(|room| !room.room.is_empty()).collect();
    let columns = shown.len().clamp(1, 3);
    let lines = shown.len().div_ceil(columns).max(1);
    let (width, height) = (columns as f64 * step, lines as f64 * (step + 0.3 * hole));
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width:.3} {height:.3}\" role=\"img\" aria-label=\"Sections of the shaft in the hole\">"
    );
    for (k, room) in shown.iter().enumerate() {
        let x = (0.5 + (k % columns) as f64) * step;
        let y = 0.5 * step + (k / columns) as f64 * (step + 0.3 * hole);
        let cos = room.tilt_deg.to_radians().cos();
        let pushed = room.room.first().map_or(0.0, |p| p.1);
        let thin = 0.02 * hole;
        let _ = write!(
            svg,
            "<circle cx=\"{x:.3}\" cy=\"{y:.3}\" r=\"{hole:.3}\" fill=\"none\" stroke=\"currentColor\" \
             stroke-width=\"{thin:.3}\"/><ellipse cx=\"{:.3}\" cy=\"{y:.3}\" rx=\"{:.3}\" ry=\"{:.3}\" fill=\"{}\" \
             fill-opacity=\"0.35\" stroke=\"{}\" stroke-width=\"{thin:.3}\"/><text x=\"{x:.3}\" y=\"{:.3}\" \
             font-size=\"{:.3}\" text-anchor=\"middle\" fill=\"currentColor\">{}\u{b0}</text>",
            x + pushed,
            0.5 * r.shaft_mm / cos,
            0.5 * r.shaft_mm,
            page::hex(colors::organ(1)),
            page::hex(colors::organ(1)),
            y + 1.36 * hole,
            0.26 * hole,
            room.tilt_deg
        );
    }
    svg.push_str("</svg>");
    page::figure(
        &svg,
        "<b>Section of the shaft in the plane of the port</b> at five tilts to the right, pushed to the right until \
         it touches.",
    )
}

fn around(r: &PortBudgetResult) -> Result<String> {
    let line = |(k, points): (usize, &Vec<(f64, f64)>)| Line::new(points.clone(), colors::organ(k));
    let plot = Plot {
        title: "Clearance in all directions",
        x: "angle from the direction of the tilt (\u{b0})",
        y: "clearance (mm)",
        lines: r.rooms.iter().map(|room| &room.room).enumerate().map(line).collect(),
        show: vec![0.0],
        ..Plot::default()
    };
    let names: Vec<String> = r.rooms.iter().map(|room| format!("{}\u{b0}", room.tilt_deg)).collect();
    let legend = page::legend(names.iter().enumerate().map(|(k, n)| (n.as_str(), colors::organ(k))));
    let caption = format!(
        "<b>Measured clearance</b> in all directions. Across the tilt it is (D \u{2212} d)/2 up to acos \u{221a}(d/D), \
         24.1\u{b0} for 5 in 6 mm. At larger tilts the section is \
         flatter than the hole and touches at two points.{legend}"
    );
    Ok(plot.figure(&caption)?)
}

fn loaded(r: &PortBudgetResult) -> Result<String> {
    let (free, pushed) = (colors::organ(1), colors::organ(2));
    let points = |value: &dyn Fn(&PortBudgetRow) -> Option<f64>| -> Vec<(f64, f64)> {
        r.rows.iter().filter_map(|row| value(row).map(|v| (row.tilt_deg, v))).collect()
    };
    let plot = Plot {
        title: "Deviation under load",
        x: "tilt (\u{b0})",
        y: "deviation (mm)",
        lines: vec![
            Line { points: points(&|row| row.measured_least_mm), color: free, filled: true },
            Line::new(points(&|row| Some(row.pushed_mm)), pushed),
        ],
        show: vec![0.0],
        ..Plot::default()
    };
    let push = format!("pushed with {} N", r.push_n);
    let legend = page::legend([("free in every direction", free), (push.as_str(), pushed)]);
    let caption = format!(
        "<b>Deviation under load</b>: stiffness of the rim {} N/mm (assumed; the paper states none).{legend}",
        fixed(r.stiffness_n_mm, 0)
    );
    Ok(plot.figure(&caption)?)
}

fn starts(r: &PortBudgetResult) -> Section {
    let table = Table::of(
        &r.starts,
        &[
            ("Start pose", &|s| s.arm.to_owned()),
            ("Tilt (\u{b0})", &|s| fixed(s.tilt_deg, 1)),
            ("Paper (mm)", &|s| fixed(s.paper_mm, 2)),
            ("Formula (mm)", &|s| fixed(s.clearance_mm, 4)),
            ("Measured (mm)", &|s| or_dash(s.measured_mm, 4)),
        ],
    );
    Section::new("Beside the paper", "").table(table)
}

fn rows(r: &PortBudgetResult) -> Section {
    let table = Table::of(
        r.rows.iter().step_by(EVERY),
        &[
            ("Tilt (\u{b0})", &|row| fixed(row.tilt_deg, 1)),
            ("Formula (mm)", &|row| fixed(row.clearance_mm, 4)),
            ("Measured, along the tilt (mm)", &|row| or_dash(row.measured_mm, 4)),
            ("opposite (mm)", &|row| or_dash(row.measured_against_mm, 4)),
            ("across (mm)", &|row| or_dash(row.measured_across_mm, 4)),
            ("Smallest in any direction (mm)", &|row| or_dash(row.measured_least_mm, 4)),
            ("Pushed (mm)", &|row| fixed(row.pushed_mm, 4)),
            ("1 mm sheet (mm)", &|row| fixed(row.thicker_mm[0], 4)),
            ("2 mm sheet (mm)", &|row| fixed(row.thicker_mm[1], 4)),
        ],
    );
    Section::new("Over tilt", "A dash: the centred shaft touches.").table(table.on_page_only())
}
