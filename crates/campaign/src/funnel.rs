//! Share of episodes that pass each stage: a bar with its Wilson interval per policy and stage, as
//! inline SVG.

use crate::table::{CampaignResult, StageCount};
use std::fmt::Write;
use trocar_report::colors;
use trocar_report::page::{escape, hex};

/// Sizes (px): names of policies, a row, the heads of columns, the count beside a bar, the picture.
const NAMES: usize = 120;
const ROW: usize = 34;
const HEAD: usize = 26;
const COUNT: usize = 62;
const WIDTH: usize = 1120;
/// Longer names of policies are cut to this (characters).
const MAX_NAME_LENGTH: usize = 16;

/// One row per policy, one column per stage: the share that passed as a filled bar, its interval as
/// a whisker, and the count.
pub(super) fn funnel(r: &CampaignResult) -> String {
    let Some(first) = r.policies.first().filter(|p| !p.stages.is_empty()) else { return String::new() };
    let column = (WIDTH - NAMES) / first.stages.len();
    let height = HEAD + ROW * r.policies.len();
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {height}\" width=\"100%\" role=\"img\" aria-label=\"Episodes that pass each stage\" \
         font-size=\"13\" fill=\"currentColor\" stroke=\"none\">"
    );
    for (n, stage) in first.stages.iter().enumerate() {
        let _ =
            write!(svg, "<text x=\"{}\" y=\"16\" opacity=\"0.7\">{}</text>", NAMES + n * column, escape(&stage.stage));
    }
    for (k, policy) in r.policies.iter().enumerate() {
        let y = HEAD + k * ROW;
        let name: String = policy.policy.chars().take(MAX_NAME_LENGTH).collect();
        let _ = write!(svg, "<text x=\"0\" y=\"{}\">{}</text>", y + 18, escape(&name));
        for (n, stage) in policy.stages.iter().enumerate() {
            bar(&mut svg, [NAMES + n * column, y], column - COUNT, stage, policy.episodes, &hex(colors::organ(k)));
        }
    }
    svg + "</svg>"
}

fn bar(svg: &mut String, [x, y]: [usize; 2], width: usize, stage: &StageCount, all: usize, color: &str) {
    let at = |share: f64| x as f64 + share * width as f64;
    let i = &stage.interval;
    let (low, high, middle) = (at(i.low), at(i.high), y + 13);
    let _ = write!(
        svg,
        "<rect x=\"{x}\" y=\"{}\" width=\"{width}\" height=\"16\" opacity=\"0.08\"/>\
         <rect x=\"{x}\" y=\"{}\" width=\"{:.1}\" height=\"16\" fill=\"{color}\" opacity=\"0.75\"/>\
         <path d=\"M{low:.1} {middle}H{high:.1}M{low:.1} {}v8M{high:.1} {}v8\" stroke=\"currentColor\" stroke-width=\"1.5\" fill=\"none\"/>\
         <text x=\"{}\" y=\"{}\" opacity=\"0.8\">{}/{all}</text>",
        y + 5,
        y + 5,
        i.share * width as f64,
        middle - 4,
        middle - 4,
        x + width + 6,
        y + 18,
        stage.passed
    );
}
