//! The page of the controller grid.

use super::motion::ControllerInstant;
use super::result::{ControllerGridResult, ControllerRow, MARGIN};
use crate::Result;
use crate::trials::resumed;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, percent, yes_or_no};
use trocar_robot::manipulator::Law;

/// Number of rows of the table.
const BEST: usize = 10;
/// Half the size of a marker, as a share of its value.
const MARK: f64 = 0.025;
/// Time range of the response plot (s).
const RESPONSE: (f64, f64) = (0.9, 2.6);

pub(super) fn document(r: &ControllerGridResult) -> Result<Document> {
    let lead = format!(
        "{} configurations: seven kinds of control, thirteen bandwidths, two damping ratios. Both arms of the cell \
         perform the same motion with each: corners, sines, 1\u{202f}N on the tip, rest, then impulses of \
         25\u{202f}N and steps of the command. The model assumes links 2% and instruments 5% too light and no \
         friction; every joint has 0.2\u{202f}N\u{202f}m instead of the arm\u{2019}s own. The lowest bandwidth that \
         is {} below every target is chosen: this simulation has no sensor noise and no gear compliance, which limit \
         the bandwidth of a real arm.",
        r.rows.len(),
        percent(MARGIN, 0)
    );
    let section = Section::new("Controller grid", lead).cards(cards(r)).figures([
        scatter(r)?,
        droops(r)?,
        response(r)?,
        errors(r)?,
    ]);
    let subtitle = "182 configurations on the same motion, and the chosen one";
    Ok(Document::new("Controllers", subtitle).with(section).with(friction(r)).with(best(r)))
}

fn cards(r: &ControllerGridResult) -> Vec<Card> {
    let mut all = Vec::new();
    if let Some(c) = &r.chosen {
        let f = &c.figures;
        let mm = |v: f64| format!("{} mm", fixed(v, 3));
        let gains = format!(
            "{} rad/s, damping {}{}; {}",
            fixed(c.bandwidth, 0),
            fixed(c.damping, 1),
            c.observer.or(c.integral).map_or(String::new(), |o| format!(", correction {} rad/s", fixed(o, 0))),
            if r.chosen_is_default { "the program\u{2019}s default" } else { "not the program\u{2019}s default" }
        );
        all.push(Card::new("Chosen", c.controller.clone(), gains));
        let paper = |v: f64| format!("paper {v} mm");
        let note = paper(r.bars.rcm_p95_mm);
        all.push(Card::new("RCM deviation, p95", mm(f.rcm_p95_mm), note).met(f.rcm_p95_mm <= r.bars.rcm_p95_mm));
        let note = format!("RMS, at equal times; {}", paper(r.bars.tracking_rms_mm));
        let met = f.tracking_rms_mm <= r.bars.tracking_rms_mm;
        all.push(Card::new("Tracking against the filtered reference", mm(f.tracking_rms_mm), note).met(met));
        let note = format!(
            "RMS, at equal times; the command is held at 30 Hz; the tip is {} ms behind it",
            fixed(1e3 * f.command_lag_s, 1)
        );
        all.push(Card::new("Tracking against the command", mm(f.command_rms_mm), note));
        let note = paper(r.bars.droop_mm);
        all.push(Card::new("Droop", mm(f.droop_mm), note).met(f.droop_mm <= r.bars.droop_mm));
        let note = format!("behind the command, held at 30 Hz; {} ms behind the reference", fixed(1e3 * f.lag_s, 2));
        all.push(Card::new("Lag", format!("{} ms", fixed(1e3 * f.command_lag_s, 1)), note));
    }
    let note = format!("also under impulses; {} meet all targets", r.within_bars);
    all.push(Card::new("Stable", format!("{} of {}", r.stable, r.rows.len()), note));
    all
}

/// The colour of a law.
fn color(controller: &str) -> [u8; 3] {
    colors::organ(Law::ALL.iter().position(|l| l.name() == controller).unwrap_or(7))
}

/// A marker on logarithmic axes: a cross of two short lines, because plots have no markers.
fn cross(x: f64, y: f64, size: f64, color: [u8; 3]) -> [Line; 2] {
    // The y axes span more decades on less length.
    let line = |points| Line::new(points, color);
    let (a, b, tall) = (1.0 - size, 1.0 + size, 1.0 + 3.0 * size);
    [line(vec![(x * a, y), (x * b, y)]), line(vec![(x, y / tall), (x, y * tall)])]
}

/// Markers of all stable rows, the chosen one and the paper's point.
fn marks(r: &ControllerGridResult, of: impl Fn(&ControllerRow) -> (f64, f64), paper: (f64, f64)) -> Vec<Line> {
    let mut lines = Vec::new();
    for row in r.rows.iter().filter(|row| row.figures.stable) {
        let (x, y) = of(row);
        lines.extend(cross(x, y, MARK, color(&row.controller)));
    }
    if let Some(c) = &r.chosen {
        let (x, y) = of(c);
        let corner = |a: f64, b: f64| (x * (1.0 + a), y * (1.0 + b));
        let (s, d) = (0.13, -0.115);
        let points = vec![corner(d, d), corner(s, d), corner(s, s), corner(d, s), corner(d, d)];
        lines.push(Line::new(points, color(&c.controller)));
    }
    lines.extend(cross(paper.0, paper.1, 4.0 * MARK, PAPER));
    lines
}

/// Colour of the paper's point.
const PAPER: [u8; 3] = [200, 30, 40];

fn legend(r: &ControllerGridResult) -> String {
    let laws = Law::ALL.iter().filter(|l| r.rows.iter().any(|row| row.controller == l.name()));
    page::legend(laws.map(|l| (l.name(), color(l.name()))).chain([("the paper\u{2019}s (large cross)", PAPER)]))
}

fn scatter(r: &ControllerGridResult) -> Result<String> {
    let of = |row: &ControllerRow| (row.figures.tracking_rms_mm, row.figures.rcm_p95_mm);
    let plot = Plot {
        title: "RCM deviation against tracking",
        x: "tracking, RMS (mm)",
        y: "RCM deviation, p95 (mm)",
        lines: marks(r, of, (r.bars.tracking_rms_mm, r.bars.rcm_p95_mm)),
        limits: vec![r.bars.rcm_p95_mm],
        log_x: true,
        log_y: true,
        ..Plot::default()
    };
    let caption = format!("<b>All stable configurations</b>; the chosen one has a frame.{}", legend(r));
    Ok(plot.figure(&caption)?)
}

fn droops(r: &ControllerGridResult) -> Result<String> {
    let of = |row: &ControllerRow| (row.bandwidth, row.figures.droop_mm.max(1e-4));
    let mut lines = marks(r, of, (f64::NAN, f64::NAN));
    lines.retain(|l| l.points.iter().all(|p| p.0.is_finite()));
    let plot = Plot {
        title: "Droop over bandwidth",
        x: "bandwidth (rad/s)",
        y: "droop at rest (mm)",
        lines,
        limits: vec![r.bars.droop_mm],
        log_x: true,
        log_y: true,
        ..Plot::default()
    };
    let caption = "<b>Droop at rest</b> over the bandwidth; dashed: the paper. Without integral action or observer \
                   it decreases with the stiffness.";
    Ok(plot.figure(caption)?)
}

fn response(r: &ControllerGridResult) -> Result<String> {
    let names = ["raw command, held", "reference", "tip"];
    let colors = [colors::organ(7), colors::organ(1), colors::organ(4)];
    let within = |i: &&ControllerInstant| (RESPONSE.0..RESPONSE.1).contains(&i.time_s);
    let points = |k: usize| r.trace.iter().filter(within).map(|i| (i.time_s, i.along_mm[k])).collect();
    let line = |k: usize| Line::new(points(k), colors[k]);
    let plot = Plot {
        title: "Response to a move",
        x: "time (s)",
        y: "along the move (mm)",
        lines: (0..3).map(line).collect(),
        ..Plot::default()
    };
    let entries = names.iter().zip(colors).map(|(n, c)| (*n, c));
    let caption = format!(
        "<b>The first move of the left arm</b>: the reference is a delayed spline through the commands; the tip \
         follows it.{}",
        page::legend(entries)
    );
    Ok(plot.figure(&caption)?)
}

fn errors(r: &ControllerGridResult) -> Result<String> {
    let shades = [colors::organ(7), colors::organ(4), colors::organ(2)];
    let line = |points: Vec<(f64, f64)>, color| Line::new(points, color);
    let of = |trace: &[ControllerInstant], f: fn(&ControllerInstant) -> f64| {
        trace.iter().map(|i| (i.time_s, f(i).max(1e-4))).collect()
    };
    let plot = Plot {
        title: "Error over time",
        x: "time (s)",
        y: "error (mm)",
        lines: vec![
            line(of(&r.plain_trace, |i| i.error_mm), shades[0]),
            line(of(&r.trace, |i| i.rcm_mm), shades[2]),
            line(of(&r.trace, |i| i.error_mm), shades[1]),
        ],
        log_y: true,
        ..Plot::default()
    };
    let entries = [
        ("tip, same gains without observer", shades[0]),
        ("tip, chosen", shades[1]),
        ("RCM deviation, chosen", shades[2]),
    ];
    let caption = format!("<b>The whole run of the left arm</b>.{}", page::legend(entries));
    Ok(plot.figure(&caption)?)
}

/// The chosen controller with the friction of the grid and with that of the arm.
fn friction(r: &ControllerGridResult) -> Section {
    let chosen = r.chosen.iter().map(|c| ("0.2 N m, as in the grid", &c.figures));
    let own = r.chosen_with_own_friction.iter().map(|f| ("the FR3\u{2019}s own, 1.137 and 0.763 N m", f));
    let table = Table::of(
        chosen.chain(own),
        &[
            ("Friction in each joint", &|(name, _)| (*name).to_owned()),
            ("RCM p95 (mm)", &|(_, f)| fixed(f.rcm_p95_mm, 4)),
            ("Tracking against the reference (mm)", &|(_, f)| fixed(f.tracking_rms_mm, 4)),
            ("Tracking against the command (mm)", &|(_, f)| fixed(f.command_rms_mm, 3)),
            ("Droop (mm)", &|(_, f)| fixed(f.droop_mm, 4)),
            ("Stable", &|(_, f)| yes_or_no(f.stable)),
        ],
    );
    Section::new(
        "Friction",
        "The grid uses 0.2 N m in every joint instead of the FR3\u{2019}s own Coulomb friction, which its model \
         states as 1.137 N m for joints 1 to 4 and 0.763 N m for joints 5 to 7. The table shows the chosen \
         controller with both.",
    )
    .table(table)
}

fn best(r: &ControllerGridResult) -> Section {
    let mut sorted: Vec<&ControllerRow> = r.rows.iter().collect();
    sorted.sort_by(|a, b| a.share_of_targets().total_cmp(&b.share_of_targets()));
    let chosen = r.chosen.iter().map(|c| ("chosen", c));
    let table = Table::of(
        chosen.chain(sorted.into_iter().take(BEST).map(|row| ("", row))),
        &[
            ("", &|(name, _)| (*name).to_owned()),
            ("Controller", &|(_, row)| row.controller.clone()),
            ("Bandwidth (rad/s)", &|(_, row)| fixed(row.bandwidth, 0)),
            ("Damping", &|(_, row)| fixed(row.damping, 1)),
            ("Correction (rad/s)", &|(_, row)| fixed(row.observer.or(row.integral).unwrap_or(f64::NAN), 0)),
            ("RCM p95 (mm)", &|(_, row)| fixed(row.figures.rcm_p95_mm, 4)),
            ("Tracking against the reference (mm)", &|(_, row)| fixed(row.figures.tracking_rms_mm, 4)),
            ("Tracking against the command (mm)", &|(_, row)| fixed(row.figures.command_rms_mm, 3)),
            ("Droop (mm)", &|(_, row)| fixed(row.figures.droop_mm, 4)),
            ("Lag (ms)", &|(_, row)| fixed(1e3 * row.figures.lag_s, 2)),
            ("RCM peak under impulses (mm)", &|(_, row)| fixed(row.figures.rough_rcm_mm.unwrap_or(f64::NAN), 2)),
            ("Peak torque (N m)", &|(_, row)| fixed(row.figures.torque_peak, 1)),
            ("Peak torque over limit", &|(_, row)| percent(row.figures.torque_share, 0)),
            ("Worst figure over target", &|(_, row)| percent(row.share_of_targets(), 0)),
        ],
    );
    Section::new("The chosen and the best ten", "Sorted by the worst figure over its target.")
        .table(table)
        .lines(resumed(&r.resumed, "configuration"))
}
