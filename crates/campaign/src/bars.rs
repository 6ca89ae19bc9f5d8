//! Shares of episodes as bars with their Wilson intervals, in rows and columns, as inline SVG.

use crate::curves::Curve;
use crate::interval::Interval;
use crate::table::CampaignResult;
use std::fmt::Write;
use trocar_report::colors;
use trocar_report::page::{escape, hex};

/// Sizes (px): names of rows, a row, the heads of columns, the count beside a bar, the picture.
const NAMES: usize = 120;
const ROW: usize = 34;
const HEAD: usize = 26;
const COUNT: usize = 62;
const WIDTH: usize = 1120;
/// Longer names of rows are cut to this (characters).
const MAX_NAME_LENGTH: usize = 16;

/// The share of `passed` of `all`.
struct Bar {
    passed: usize,
    all: usize,
    interval: Interval,
    color: [u8; 3],
}

/// One row per policy, one column per stage.
pub(super) fn stages(r: &CampaignResult) -> String {
    let columns = r.policies.first().map_or_else(Vec::new, |p| p.stages.iter().map(|s| s.stage.as_str()).collect());
    let row = |(k, p): (usize, &crate::table::PolicyRow)| {
        let bar = |s: &crate::table::StageCount| Bar {
            passed: s.passed,
            all: p.episodes,
            interval: s.interval,
            color: colors::organ(k),
        };
        (p.policy.clone(), p.stages.iter().map(bar).collect())
    };
    bars("Episodes that pass each stage", &columns, &r.policies.iter().enumerate().map(row).collect::<Vec<_>>())
}

/// One row per value, one column per policy.
pub(super) fn values(curve: &Curve) -> String {
    let columns = curve.bins.first().map_or_else(Vec::new, |b| b.policies.iter().map(|s| s.policy.as_str()).collect());
    let row = |bin: &crate::curves::Bin| {
        let bar = |(k, s): (usize, &crate::curves::Share)| Bar {
            passed: s.passed,
            all: s.episodes,
            interval: s.interval,
            color: colors::organ(k),
        };
        (bin.value.clone(), bin.policies.iter().enumerate().map(bar).collect())
    };
    bars(&format!("Success by {}", curve.name), &columns, &curve.bins.iter().map(row).collect::<Vec<_>>())
}

/// The share as a filled bar, its interval as a whisker, and the count.
fn bars(title: &str, columns: &[&str], rows: &[(String, Vec<Bar>)]) -> String {
    if columns.is_empty() || rows.is_empty() {
        return String::new();
    }
    let column = (WIDTH - NAMES) / columns.len();
    let height = HEAD + ROW * rows.len();
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {height}\" width=\"100%\" role=\"img\" aria-label=\"{}\" \
         font-size=\"13\" fill=\"currentColor\" stroke=\"none\">",
        escape(title)
    );
    for (n, name) in columns.iter().enumerate() {
        let _ = write!(svg, "<text x=\"{}\" y=\"16\" opacity=\"0.7\">{}</text>", NAMES + n * column, escape(name));
    }
    for (k, (name, own)) in rows.iter().enumerate() {
        let y = HEAD + k * ROW;
        let name: String = name.chars().take(MAX_NAME_LENGTH).collect();
        let _ = write!(svg, "<text x=\"0\" y=\"{}\">{}</text>", y + 18, escape(&name));
        for (n, bar) in own.iter().enumerate() {
            draw(&mut svg, [NAMES + n * column, y], column.saturating_sub(COUNT), bar);
        }
    }
    svg + "</svg>"
}

fn draw(svg: &mut String, [x, y]: [usize; 2], width: usize, bar: &Bar) {
    let at = |share: f64| x as f64 + share * width as f64;
    let i = &bar.interval;
    let (low, high, middle) = (at(i.low), at(i.high), y + 13);
    let _ = write!(
        svg,
        "<rect x=\"{x}\" y=\"{}\" width=\"{width}\" height=\"16\" opacity=\"0.08\"/>\
         <rect x=\"{x}\" y=\"{}\" width=\"{:.1}\" height=\"16\" fill=\"{}\" opacity=\"0.75\"/>\
         <path d=\"M{low:.1} {middle}H{high:.1}M{low:.1} {}v8M{high:.1} {}v8\" stroke=\"currentColor\" stroke-width=\"1.5\" fill=\"none\"/>\
         <text x=\"{}\" y=\"{}\" opacity=\"0.8\">{}/{}</text>",
        y + 5,
        y + 5,
        i.share * width as f64,
        hex(bar.color),
        middle - 4,
        middle - 4,
        x + width + 6,
        y + 18,
        bar.passed,
        bar.all
    );
}
