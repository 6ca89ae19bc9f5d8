//! The map of the study: a row a factor, a column a controller, a box a value. A box is filled as
//! far as the share of episodes that passed.

use std::fmt::Write;
use trocar_campaign::{Bin, Curve, Share};
use trocar_report::colors;
use trocar_report::page::{self, escape, hex};

/// Sizes (px): the whole width, names of factors, heads of columns, a row, a box's height, the
/// space between columns, the greatest width of a box.
const WIDTH: usize = 1120;
const NAMES: usize = 280;
const HEAD: usize = 26;
const ROW: usize = 38;
const BOX: usize = 24;
const BETWEEN: usize = 18;
const WIDEST: usize = 30;

/// The map of `curves` over the same `policies`, with its caption.
pub(super) fn map(policies: &[&str], curves: &[Curve]) -> String {
    if policies.is_empty() || curves.is_empty() {
        return String::new();
    }
    let column = (WIDTH - NAMES) / policies.len();
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {}\" width=\"100%\" role=\"img\" aria-label=\"Success by factor\" \
         font-size=\"13\" fill=\"currentColor\" stroke=\"none\">",
        HEAD + ROW * curves.len()
    );
    for (k, name) in policies.iter().enumerate() {
        let _ = write!(svg, "<text x=\"{}\" y=\"16\" opacity=\"0.7\">{}</text>", NAMES + k * column, escape(name));
    }
    for (n, curve) in curves.iter().enumerate() {
        let y = HEAD + n * ROW;
        let _ = write!(
            svg,
            "<text x=\"0\" y=\"{}\">{}</text><text x=\"0\" y=\"{}\" font-size=\"11\" opacity=\"0.65\">{}</text>",
            y + 13,
            escape(&curve.label),
            y + 28,
            escape(&ends(&curve.bins))
        );
        let wide = (column.saturating_sub(BETWEEN) as f64 / curve.bins.len().max(1) as f64).min(WIDEST as f64);
        for (v, bin) in curve.bins.iter().enumerate() {
            for (k, share) in bin.policies.iter().enumerate() {
                let x = (NAMES + k * column) as f64 + v as f64 * wide;
                draw(&mut svg, [x, (y + 3) as f64], wide, bin, share, &hex(colors::organ(k)));
            }
        }
    }
    page::figure(
        &(svg + "</svg>"),
        "<b>Success by factor.</b> A box for each value, in order. It is filled as far as the share of episodes that \
         passed.",
    )
}

/// The first and the last value.
fn ends(bins: &[Bin]) -> String {
    match bins {
        [] => String::new(),
        [only] => only.value.clone(),
        [first, .., last] => format!("{} to {}", first.value, last.value),
    }
}

fn draw(svg: &mut String, [x, y]: [f64; 2], wide: f64, bin: &Bin, share: &Share, color: &str) {
    // Neighbouring boxes do not touch.
    let (width, full) = ((0.88 * wide).max(1.0), BOX as f64);
    let high = full * share.interval.share;
    let _ = write!(
        svg,
        "<g><title>{}: {} of {}</title><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{full:.1}\" \
         opacity=\"0.09\"/><rect x=\"{x:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{high:.1}\" fill=\"{color}\" \
         opacity=\"0.85\"/></g>",
        escape(&bin.value),
        share.passed,
        share.episodes,
        y + full - high
    );
}
