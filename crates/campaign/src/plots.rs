//! The plots of a campaign's page: distributions over episodes, and sweeps over gates.

use crate::bars;
use crate::curves::Curve;
use crate::interval::Interval;
use crate::manifest::Manifest;
use crate::policy_spec::PolicySpec;
use crate::store::{EpisodeRecord, Store};
use trocar_report::colors;
use trocar_report::page;
use trocar_report::plots::{Line, Plot};
use trocar_task::{CHANNELS_FILE, GateRange, read_channels, sweep};
use trocar_workflow::Result;

/// Maximum number of episodes per policy whose channels the gate sweeps read.
const MAX_SWEPT: usize = 60;
/// Half the size of a mark, as a share of the plot.
const MARK_SIZE: f64 = 0.012;
/// Distance between the marks of two policies, as a share of the plot.
const BESIDE: f64 = 0.015;
/// RCM deviation at which the hardware stops (mm).
const ABORT_MM: f64 = 5.0;

fn color(manifest: &Manifest, name: &str) -> [u8; 3] {
    colors::organ(manifest.policies.iter().position(|p| p.name == name).unwrap_or(0))
}

/// A figure of `plot` under the `caption` and the legend of the policies.
fn figure(manifest: &Manifest, plot: &Plot<'_>, caption: &str) -> Result<String> {
    let legend = page::legend(manifest.policies.iter().map(|p| (p.name.as_str(), color(manifest, &p.name))));
    Ok(plot.figure(&format!("{caption}{legend}"))?)
}

/// A plot of the share of episodes, from 0 to 1, against `x`.
fn share_plot<'a>(title: &'a str, x: &'a str, y: &'a str, lines: Vec<Line>) -> Plot<'a> {
    Plot { title, x, y, lines, show: vec![0.0, 1.0], ..Plot::default() }
}

/// Lift against RCM deviation of every episode with a grasp, as in the paper's Fig. 6(d, e).
///
/// # Errors
/// A plot that cannot be drawn.
pub fn lift_and_rcm(manifest: &Manifest, records: &[EpisodeRecord]) -> Result<String> {
    let attached: Vec<&EpisodeRecord> = records.iter().filter(|k| k.summary.attached).collect();
    let max = |of: &dyn Fn(&EpisodeRecord) -> f64| attached.iter().map(|k| of(k)).fold(1e-3, f64::max);
    let height = max(&|k| k.summary.rcm_peak_mm);
    // The x axis begins at the smallest value and the y axis at zero, so that marks look square.
    let lift = |k: &EpisodeRecord| k.summary.lift_mm.unwrap_or(0.0);
    let min = attached.iter().map(|k| lift(k)).fold(f64::INFINITY, f64::min);
    let width = (max(&lift) - min).max(1.0);
    let mut lines = Vec::new();
    for k in &attached {
        let (x, y, color) = (lift(k), k.summary.rcm_peak_mm, color(manifest, &k.name));
        let (a, b) = (MARK_SIZE * width, 2.0 * MARK_SIZE * height);
        lines.push(Line::new(vec![(x - a, y), (x + a, y)], color));
        lines.push(Line::new(vec![(x, y - b), (x, y + b)], color));
    }
    let threshold = manifest.rcm_threshold_mm;
    let plot = Plot {
        title: "Lift against RCM deviation",
        x: "greatest lift (mm)",
        y: "largest RCM deviation (mm)",
        lines,
        show: vec![0.0],
        limits: if height > 0.5 * threshold { vec![threshold, ABORT_MM] } else { vec![] },
        ..Plot::default()
    };
    figure(manifest, &plot, "<b>Lift against RCM deviation</b>, every episode with a grasp.")
}

/// The distribution of the lift per policy, over the episodes with a grasp.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn lifts(manifest: &Manifest, records: &[EpisodeRecord]) -> Result<String> {
    distribution(manifest, records, "Lift", "greatest lift of held tissue (mm)", &|k| k.summary.lift_mm)
}

/// The distributions of the page.
pub(super) fn distributions(manifest: &Manifest, records: &[EpisodeRecord]) -> Result<Vec<String>> {
    type ValueOf = fn(&EpisodeRecord) -> Option<f64>;
    let all: [(&str, &str, ValueOf); 6] = [
        ("RCM deviation", "largest RCM deviation of the episode (mm)", |k| Some(k.summary.rcm_peak_mm)),
        ("Contact force", "peak contact force on an instrument (N)", |k| Some(k.peak(|a| a.peak_contact_n))),
        ("Constraint force", "peak pull of held tissue (N)", |k| Some(k.peak(|a| a.peak_constraint_n))),
        ("Jaw force", "peak force of tissue on the blades of a jaw (N)", |k| Some(k.peak(|a| a.peak_jaw_n))),
        ("Tracking lag", "delay of the measured tip behind the commanded tip (ms)", EpisodeRecord::lag_ms),
        ("Lift", "greatest lift of held tissue (mm)", |k| k.summary.lift_mm),
    ];
    let mut figures = vec![lift_and_rcm(manifest, records)?];
    for (name, x, of) in all {
        figures.push(distribution(manifest, records, name, x, &of)?);
    }
    Ok(figures)
}

/// The cumulative distribution of `of` per policy. Episodes without a value are left out.
fn distribution(
    manifest: &Manifest,
    records: &[EpisodeRecord],
    name: &str,
    x: &str,
    of: &dyn Fn(&EpisodeRecord) -> Option<f64>,
) -> Result<String> {
    let line = |policy: &PolicySpec| {
        let mut values: Vec<f64> = records.iter().filter(|k| k.name == policy.name).filter_map(of).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len().max(1) as f64;
        let steps = values.iter().enumerate().flat_map(|(k, v)| [(*v, k as f64 / n), (*v, (k as f64 + 1.0) / n)]);
        Line::new(steps.collect(), color(manifest, &policy.name))
    };
    let lines = manifest.policies.iter().map(line).collect();
    figure(manifest, &share_plot(name, x, "share of episodes", lines), &format!("<b>{name}.</b>"))
}

/// The share of episodes that passed for each name of `curve`, with intervals.
pub fn success_by_name(curve: &Curve) -> String {
    let name = page::escape(&curve.name);
    page::figure(&bars::values(curve), &format!("<b>Success by {name}.</b> Whiskers: 95% intervals."))
}

/// The share of episodes of `policies` that passed over the numbers of `curve`, with intervals.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn success_over(policies: &[&str], curve: &Curve) -> Result<String> {
    let numbers: Vec<[f64; 3]> = curve.bins.iter().filter_map(|bin| bin.numbers).collect();
    let scale = |x: f64| if curve.log { x.ln() } else { x };
    let unscale = |x: f64| if curve.log { x.exp() } else { x };
    let (low, high) = (numbers.first().map_or(0.0, |n| scale(n[0])), numbers.last().map_or(1.0, |n| scale(n[2])));
    let (width, count) = (high - low, policies.len());
    let mut lines = Vec::new();
    for k in 0..count {
        let color = colors::organ(k);
        // Policies are drawn side by side: their whiskers must not overlap.
        let aside = BESIDE * width * (k as f64 - 0.5 * (count as f64 - 1.0));
        let shares = curve.bins.iter().filter_map(|bin| Some((bin.numbers?[1], bin.policies.get(k)?)));
        let points: Vec<(f64, &Interval)> = shares
            .filter(|(_, share)| share.episodes > 0)
            .map(|(x, share)| (scale(x) + aside, &share.interval))
            .collect();
        lines.push(Line::new(points.iter().map(|(x, i)| (unscale(*x), i.share)).collect(), color));
        for (x, i) in points {
            let cap = 0.5 * MARK_SIZE * width;
            lines.push(Line::new(vec![(unscale(x), i.low), (unscale(x), i.high)], color));
            for end in [i.low, i.high] {
                lines.push(Line::new(vec![(unscale(x - cap), end), (unscale(x + cap), end)], color));
            }
            let mark = vec![(unscale(x - MARK_SIZE * width), i.share), (unscale(x + MARK_SIZE * width), i.share)];
            lines.push(Line::new(mark, color));
        }
    }
    let title = format!("Success by {}", curve.name);
    let plot = Plot { log_x: curve.log, ..share_plot(&title, &curve.label, "share of episodes that passed", lines) };
    let legend = page::legend(policies.iter().enumerate().map(|(k, name)| (*name, colors::organ(k))));
    Ok(plot.figure(&format!("<b>{}.</b>{legend}", page::escape(&title)))?)
}

/// The gates that are swept for a task: the range, and the label of its axis.
fn swept_gates(task: &str) -> &'static [(&'static str, &'static str)] {
    match task {
        "appendix-resection" => &[
            ("lift_mm=2..16:0.5", "lift gate (mm)"),
            ("cut_closed=0.05..0.50:0.025", "jaw opening below which the cut counts"),
        ],
        "grasp-lift" => {
            &[("lift_mm=2..16:0.5", "lift gate (mm)"), ("lift_s=0.1..1.5:0.1", "time that the lift must last (s)")]
        }
        _ => &[],
    }
}

/// The share of episodes that pass at other gates, computed from stored channels.
pub(super) fn sweeps(manifest: &Manifest, records: &[EpisodeRecord], store: &Store) -> Result<Vec<String>> {
    let mut channels = Vec::new();
    let mut truncated = false;
    for policy in &manifest.policies {
        let own: Vec<&EpisodeRecord> = records.iter().filter(|k| k.name == policy.name).collect();
        truncated |= own.len() > MAX_SWEPT;
        let count = own.len().min(MAX_SWEPT);
        // An episode that ended before its first step has no channels and passes no gate.
        let with_channels = own.into_iter().take(MAX_SWEPT).filter(|k| k.summary.duration_s > 0.0);
        let read = with_channels.map(|k| read_channels(&store.episode(&k.name, k.index).join(CHANNELS_FILE)));
        channels.push((policy, count, read.collect::<std::result::Result<Vec<_>, _>>()?));
    }
    let note = if truncated { format!(" The first {MAX_SWEPT} episodes of each policy.") } else { String::new() };
    let mut figures = Vec::new();
    for (range, x) in swept_gates(&manifest.task) {
        let range = GateRange::parse(range)?;
        let mut lines = Vec::new();
        for (policy, count, episodes) in channels.iter().filter(|(.., episodes)| !episodes.is_empty()) {
            let swept = sweep(episodes, std::slice::from_ref(&range), &mut || true)?;
            let points = swept.rows.iter().map(|r| (r.values[0], r.passed as f64 / *count as f64));
            lines.push(Line::new(points.collect(), color(manifest, &policy.name)));
        }
        let plot = share_plot(x, x, "share of episodes that pass", lines);
        figures.push(figure(manifest, &plot, &format!("<b>{x}.</b>{note}"))?);
    }
    Ok(figures)
}
