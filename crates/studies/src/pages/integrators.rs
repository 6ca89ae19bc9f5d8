//! The page of the integrators' comparison.

use crate::Result;
use crate::experiment::{IntegratorRow, IntegratorsResult, SPEED_LIMIT};
use trocar_report::colors;
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed, percent};

pub(super) fn body(result: &IntegratorsResult) -> Result<String> {
    let damping = if result.undamped { "without dashpots" } else { "with the cell's dashpots" };
    let lead = format!(
        "{} ({} elements, {} nodes), at rest in its rest shape, released under gravity {damping}. The greatest speed of any node at the end of each frame of 1/60 s; the \
         dashed line is the paper's limit of {SPEED_LIMIT} m/s, at which a run ends here. Nothing is clamped.",
        page::escape(&result.specimen),
        count(result.tets),
        count(result.nodes),
    );
    let line = |(k, row): (usize, &IntegratorRow)| {
        // A run that ends in its first frame is a short mark rather than a point.
        let mut points = row.speeds.clone();
        if let [(t, v)] = points[..] {
            points = vec![(0.0, v), (t, v)];
        }
        Line { points, color: color(k), filled: false }
    };
    let plot = Plot {
        title: "Greatest node speed",
        x: "time since release [s]",
        y: "speed [m/s]",
        lines: result.integrators.iter().enumerate().map(line).collect(),
        bands: vec![],
        show: vec![],
        limits: vec![SPEED_LIMIT],
        log_x: false,
        log_y: true,
    };
    let legend = page::legend(result.integrators.iter().enumerate().map(|(k, r)| (r.name, color(k))));
    let figure = page::figure(&plot.svg()?, &format!("<b>Fig. 6(b) anew.</b>{legend}"));
    let body = page::section("What stays bounded", &lead, &(cards(result) + &figure));
    Ok(body + &page::section("What the data say", "", &page::list(&result.findings)) + &rows(result))
}

/// There are more forms than hues of organs; the last ones have their own.
fn color(k: usize) -> [u8; 3] {
    match k {
        0..8 => colors::organ(k),
        8 => [150, 90, 60],
        _ => [190, 30, 60],
    }
}

fn cards(result: &IntegratorsResult) -> String {
    let bounded = result.integrators.iter().filter(|r| r.bounded).count();
    let best = |start: &str| {
        let rows = result.integrators.iter().filter(|r| r.name.starts_with(start));
        rows.filter_map(|r| r.sag_error).min_by(f64::total_cmp).map_or("none".to_owned(), |e| percent(e, 2))
    };
    page::cards(&[
        Card::new("Bounded", format!("{bounded} of {}", result.integrators.len()), "ran to the end below 20 m/s"),
        Card::new(
            "Stable explicit step",
            format!("{} \u{b5}s", fixed(result.stable_step_us, 1)),
            "2/\u{3c9} of the stiffest mode at rest",
        ),
        Card::new("XPBD's least sag error", best("XPBD"), "of its bounded forms"),
        Card::new("Sag", format!("{} mm", fixed(result.sag_mm, 4)), "mean displacement in the static equilibrium"),
    ])
}

fn rows(result: &IntegratorsResult) -> String {
    let head = [
        "Integrator",
        "Settings",
        "The paper",
        "Outcome",
        "Peak [m/s]",
        "Last [m/s]",
        "Sag over true sag",
        "Sag error",
        "Frame [ms]",
    ];
    let or_dash = |v: Option<String>| v.unwrap_or_else(|| "\u{2013}".to_owned());
    let row = |r: &IntegratorRow| {
        let outcome = match (&r.event, r.ended_at_s) {
            (Some(event), Some(at)) => format!("{event}, after {} s", fixed(at, 3)),
            _ => "bounded".to_owned(),
        };
        vec![
            r.name.to_owned(),
            r.settings.clone(),
            r.paper.to_owned(),
            outcome,
            format!("{:.1e}", r.peak_speed_m_s),
            format!("{:.1e}", r.last_speed_m_s),
            or_dash(r.sag_ratio.map(|s| fixed(s, 2))),
            or_dash(r.sag_error.map(|e| percent(e, 2))),
            fixed(r.frame_ms, 1),
        ]
    };
    let lead = format!(
        "<i>Sag error</i>: mean distance of the nodes from the static equilibrium (Newton\u{2019}s method in double precision) over their mean displacement in it, positions \
         averaged over the last third of the run. Frames on {} threads.",
        result.threads
    );
    page::section("Every form", &lead, &table::plain(&head, &result.integrators.iter().map(row).collect::<Vec<_>>()))
}
