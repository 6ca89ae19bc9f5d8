//! An axis of a plot: positions and labels of its ticks.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::Ranged;
use std::ops::Range;

pub struct Axis {
    inner: RangedCoordf64,
    ticks: Vec<f64>,
}

impl Axis {
    /// An axis from `low` to `high` with about `max` ticks. On a logarithmic axis the ends are
    /// exponents of ten.
    pub fn new(log: bool, low: f64, high: f64, max: usize) -> Self {
        Self { inner: (low..high).into(), ticks: ticks(log, low, high, max) }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.inner.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // No minor ticks.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.inner.range()
    }
}

/// The smallest span of an axis of that `label`, which ends in its unit in round brackets: what a
/// real cell can measure. Less is noise, which a plot must not magnify.
fn min_span(label: &str) -> f64 {
    match label.rsplit_once('(').map_or("", |(_, unit)| unit.trim_end_matches(')')) {
        "mm" => 0.01,
        "m" => 1e-5,
        "N" => 0.001,
        _ => 0.0,
    }
}

/// The ends of an axis of that `label`, apart by at least what a real cell can measure. An end at 0
/// stays. On a logarithmic axis the ends are exponents of ten.
pub fn measurable((low, high): (f64, f64), label: &str, log: bool) -> (f64, f64) {
    let span = min_span(label);
    if log {
        let (a, b) = (10f64.powf(low), 10f64.powf(high));
        return if b - a < span { (low, (a + span).log10()) } else { (low, high) };
    }
    match high - low {
        wide if wide >= span => (low, high),
        _ if low == 0.0 => (0.0, span),
        narrow => {
            let beside = 0.5 * (span - narrow);
            (low - beside, high + beside)
        }
    }
}

/// The label of a tick, with the decimals that the span of the axis needs.
pub fn decimal(value: f64, span: f64) -> String {
    let decimals = (1.0 - (span / 5.0).log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    match text {
        "-0" => "0".to_owned(),
        text => text.replace('-', "\u{2212}"),
    }
}

/// Tick positions of an axis from `low` to `high`, about `max`. A logarithmic axis, whose ends are
/// exponents of ten, has ticks at powers of ten, or at every nth power; a short one at 1, 2 and 5
/// times powers of ten, or at all whole multiples if fewer than three would be left.
pub fn ticks(log: bool, low: f64, high: f64, max: usize) -> Vec<f64> {
    if !log {
        let axis: RangedCoordf64 = (low..high).into();
        return axis.key_points(max);
    }
    // Ticks at the ends are kept despite rounding.
    let reached = |v: &f64| (low - 1e-9..=high + 1e-9).contains(v);
    let decades = || (low.floor() as i64)..=(high.ceil() as i64);
    let powers: Vec<f64> = decades().map(|d| d as f64).filter(reached).collect();
    if powers.len() > 2 {
        let step = (powers.len() - 1).div_ceil(6);
        return powers.into_iter().step_by(step).collect();
    }
    let at = |multiples: &[f64]| -> Vec<f64> {
        decades().flat_map(|d| multiples.iter().map(move |m| d as f64 + m.log10())).filter(reached).collect()
    };
    let steps = at(&[1.0, 2.0, 5.0]);
    if steps.len() > 2 { steps } else { at(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]) }
}

/// The label of a tick at 10 to `exponent`, a small whole multiple of a power of ten: a plain
/// number if it is short, else a power of ten.
pub fn log_label(exponent: f64) -> String {
    let decade = (exponent + 1e-9).floor();
    let multiple = 10f64.powf(exponent - decade).round();
    if (-2.0..3.0).contains(&decade) {
        return decimal(multiple * 10f64.powf(decade), 10f64.powf(decade));
    }
    let power = power_of_ten(decade);
    if multiple == 1.0 { power } else { format!("{multiple}\u{b7}{power}") }
}

fn power_of_ten(exponent: f64) -> String {
    let digit = |c: char| match c {
        '-' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        c => char::from_u32(0x2070 + c.to_digit(10).unwrap_or(0)).unwrap_or(c),
    };
    format!("10{}", (exponent.round() as i64).to_string().chars().map(digit).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_is_not_narrower_than_what_can_be_measured() {
        let span = |(low, high): (f64, f64)| high - low;
        for (label, least) in [("slip (mm)", 0.01), ("jaw force (N)", 0.001), ("depth (m)", 1e-5)] {
            let narrow = (3.0, 3.0 + 0.1 * least);
            let wider = measurable(narrow, label, false);
            assert!((span(wider) - least).abs() < 1e-12 && wider.0 < narrow.0 && wider.1 > narrow.1, "{label}");
            assert_eq!(measurable((0.0, 0.1 * least), label, false), (0.0, least));
            assert_eq!(measurable((0.0, 2.0 * least), label, false), (0.0, 2.0 * least));
            let (low, high) = measurable((0.3, 0.3 + 1e-9), label, true);
            assert!((10f64.powf(high) - 10f64.powf(low) - least).abs() < 1e-12, "{label}");
        }
        assert_eq!(measurable((3.0, 3.0 + 1e-9), "share", false), (3.0, 3.0 + 1e-9));
        // Not force, but torque.
        assert_eq!(min_span("joint friction (N m)"), 0.0);
    }

    #[test]
    fn ticks_have_short_labels() {
        assert_eq!(decimal(0.25, 1.0), "0.25");
        assert_eq!(decimal(-0.0, 1.0), "0");
        assert_eq!(decimal(-5.0, 20.0), "\u{2212}5");
        assert_eq!(decimal(100.0, 400.0), "100");
        assert_eq!(power_of_ten(-12.0), "10\u{207b}\u{b9}\u{b2}");
        let labels = |low: f64, high: f64| -> Vec<String> {
            ticks(true, low.log10(), high.log10(), 9).into_iter().map(log_label).collect()
        };
        assert_eq!(labels(2.7, 54.0), ["5", "10", "20", "50"]);
        assert_eq!(labels(0.02, 0.3), ["0.02", "0.05", "0.1", "0.2"]);
        assert_eq!(labels(3.5, 6.5), ["4", "5", "6"]);
        assert_eq!(
            labels(2e4, 5e5),
            ["2\u{b7}10\u{2074}", "5\u{b7}10\u{2074}", "10\u{2075}", "2\u{b7}10\u{2075}", "5\u{b7}10\u{2075}"]
        );
        assert_eq!(labels(1e-3, 1.0), ["10\u{207b}\u{b3}", "0.01", "0.1", "1"]);
        assert_eq!(ticks(true, -100.0, 100.0, 9).len(), 6);
        assert_eq!(ticks(false, 0.0, 10.0, 6), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
    }
}
