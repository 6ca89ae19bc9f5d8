//! The page of the scaling benchmark.

use crate::Result;
use crate::bench::{ScalingResult, ScalingRow, Timing};
use trocar_report::colors;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed, percent};

/// What many small models may lose.
const LOSS: f64 = 0.1;

pub(super) fn body(result: &ScalingResult) -> Result<String> {
    let m = &result.machine;
    let load = m.load.map_or(String::new(), |l| {
        let busy = if l > 0.5 { "; the machine was not idle, so the figures are too low" } else { "" };
        format!(", load {} at the beginning{busy}", fixed(l, 1))
    });
    let lead = format!(
        "Our own six organs (fewer at the smallest sizes), finer and finer, the lowest 42% of each pinned and a patch of each shaken. Median of up to 60 frames of \
         1/60 s; {} cores{load}. The dashed line is real time.",
        m.cores
    );
    let plots = [
        plot(result, "Real-time factor", "times real time", &|r, t| (r.tets as f64, t.real_time_factor))?,
        plot(result, "Time per element", "\u{b5}s a frame", &|r, t| {
            (r.tets as f64, 1e3 * t.frame_ms_median / r.tets as f64)
        })?,
    ];
    let mut body = page::section("Sizes", &lead, &(page::grid(Columns::Two, &plots) + &sizes(result)));
    if !result.many.is_empty() {
        body += &page::section(
            "Many small models",
            "Each small model is an appendix with a stepper of its own; they are shared out among the threads. The same appendixes stand in one model beside them, and \
             six organs of the same total size.",
            &(cards(result) + &many(result)),
        );
    }
    Ok(body)
}

/// The schedules and threads, in the order of the rows.
fn settings(result: &ScalingResult) -> Vec<(&str, usize)> {
    let mut all: Vec<(&str, usize)> = Vec::new();
    for row in &result.rows {
        if !all.contains(&(row.schedule.as_str(), row.threads)) {
            all.push((&row.schedule, row.threads));
        }
    }
    all
}

fn plot(
    result: &ScalingResult,
    title: &'static str,
    y: &'static str,
    point: &dyn Fn(&ScalingRow, &Timing) -> (f64, f64),
) -> Result<String> {
    let settings = settings(result);
    let line = |(k, (schedule, threads)): (usize, &(&str, usize))| {
        let rows = result.rows.iter().filter(|r| (r.schedule.as_str(), r.threads) == (schedule, *threads));
        let points = rows.filter_map(|r| r.timing.as_ref().map(|t| point(r, t))).collect();
        Line { points, color: colors::organ(k), filled: false }
    };
    let lines = settings.iter().enumerate().map(line).collect();
    let limits = if title == "Real-time factor" { vec![1.0] } else { vec![] };
    let plot = Plot { title, x: "elements", y, lines, bands: vec![], show: vec![], limits, log_x: true, log_y: true };
    let names: Vec<String> = settings.iter().map(|(s, t)| format!("{s}, {}", threads(*t))).collect();
    let legend = page::legend(names.iter().enumerate().map(|(k, name)| (name.as_str(), colors::organ(k))));
    Ok(page::figure(&plot.svg()?, &format!("<b>{title}.</b>{legend}")))
}

fn threads(n: usize) -> String {
    if n == 1 { "1 thread".to_owned() } else { format!("{n} threads") }
}

fn sizes(result: &ScalingResult) -> String {
    let head = [
        "Schedule",
        "Kernels",
        "Threads",
        "Elements",
        "Nodes",
        "Frame [ms]",
        "Real time",
        "Iterations a frame",
        "Inverted",
        "Yielded",
    ];
    let row = |r: &ScalingRow| {
        let mut cells =
            vec![r.schedule.clone(), r.isa.to_owned(), r.threads.to_string(), count(r.tets), count(r.nodes)];
        match (&r.timing, &r.skipped) {
            (Some(t), _) => cells.extend([
                fixed(t.frame_ms_median, 2),
                format!("{}\u{d7}", fixed(t.real_time_factor, 2)),
                fixed(t.iterations_per_frame, 0),
                count(t.inverted),
                count(t.yielded_substeps),
            ]),
            (None, why) => cells.push(why.clone().unwrap_or_default()),
        }
        cells
    };
    table::plain(&head, &result.rows.iter().map(row).collect::<Vec<_>>())
}

fn cards(result: &ScalingResult) -> String {
    let card = |r: &crate::bench::ManyRow| {
        let note = format!("{} models, {}, {}; at most {}", r.models, r.schedule, threads(r.threads), percent(LOSS, 0));
        Card::new("Loss against one model", percent(r.loss, 1), note).met(r.loss <= LOSS)
    };
    page::cards(&result.many.iter().map(card).collect::<Vec<_>>())
}

fn many(result: &ScalingResult) -> String {
    let head = [
        "Schedule",
        "Threads",
        "Models",
        "Elements",
        "Many [ms]",
        "One model [ms]",
        "Loss",
        "Six organs [ms]",
        "their elements",
        "Loss an element",
    ];
    let row = |r: &crate::bench::ManyRow| {
        vec![
            r.schedule.clone(),
            r.threads.to_string(),
            r.models.to_string(),
            count(r.tets),
            fixed(r.many_ms, 2),
            fixed(r.one_model_ms, 2),
            percent(r.loss, 1),
            fixed(r.organs_ms, 2),
            count(r.organs_tets),
            percent(r.loss_against_organs, 1),
        ]
    };
    table::plain(&head, &result.many.iter().map(row).collect::<Vec<_>>())
}
