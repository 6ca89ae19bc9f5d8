//! The page of the settling experiment.

use crate::Result;
use crate::experiment::{SETTLED, SettlingResult};
use trocar_report::colors;
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed, percent};

pub(super) fn body(result: &SettlingResult) -> Result<String> {
    let lead = format!(
        "Each phantom recorded, reconstructed and released into the cell in its recorded shape (schedule {}). The greatest speed of any node at the end of each frame; the dashed \
         line is {SETTLED} m/s, below which each must be after a second.",
        page::escape(&result.schedule)
    );
    let line = |(k, speeds): (usize, &Vec<(f64, f64)>)| Line {
        points: speeds.clone(),
        color: colors::organ(k),
        filled: false,
    };
    let plot = Plot {
        title: "Greatest node speed",
        x: "time since release [s]",
        y: "speed [m/s]",
        lines: result.phantoms.iter().map(|p| &p.speeds).enumerate().map(line).collect(),
        bands: vec![],
        show: vec![],
        limits: vec![SETTLED],
        log_x: false,
        log_y: true,
    };
    let legend = page::legend(result.phantoms.iter().enumerate().map(|(k, p)| (p.phantom.as_str(), colors::organ(k))));
    let figure = page::figure(&plot.svg()?, &format!("<b>Fig. 6(c) anew.</b>{legend}"));
    let settled = result.phantoms.iter().filter(|p| p.settled).count();
    let cards = page::cards(&[Card::new(
        "Settled within a second",
        format!("{settled} of {}", result.phantoms.len()),
        "below 0.01 m/s; the paper: one of three",
    )
    .met(settled == result.phantoms.len())]);
    Ok(page::section("Settling", &lead, &(cards + &figure)) + &phantoms(result) + &organs(result))
}

fn phantoms(result: &SettlingResult) -> String {
    let head = [
        "Phantom",
        "Nodes",
        "Tetrahedra",
        "Pinned",
        "(paper)",
        "Peak [m/s]",
        "After 1 s [m/s]",
        "(paper)",
        "Settled after",
        "Event",
    ];
    let rows: Vec<Vec<String>> = result
        .phantoms
        .iter()
        .map(|p| {
            vec![
                p.phantom.clone(),
                count(p.nodes),
                count(p.tets),
                percent(p.pinned, 1),
                p.paper_pinned.map_or(String::new(), |s| percent(s, 1)),
                fixed(p.peak_speed_m_s, 3),
                fixed(p.speed_m_s, 4),
                p.paper_speed_m_s.map_or(String::new(), |s| fixed(s, 3)),
                p.settled_after_s.map_or("not within 1.5 s".to_owned(), |s| format!("{} s", fixed(s, 2))),
                p.event.clone().unwrap_or_default(),
            ]
        })
        .collect();
    page::section("Beside the paper", "", &table::plain(&head, &rows))
}

fn organs(result: &SettlingResult) -> String {
    let head = ["Organ", "Phantom", "Pinned", "Peak [m/s]", "After 1 s [m/s]"];
    let rows: Vec<Vec<String>> = result
        .phantoms
        .iter()
        .flat_map(|p| p.organs.iter().map(move |o| (p, o)))
        .map(|(p, o)| {
            let name = [o.organ.clone(), p.phantom.clone(), percent(o.pinned, 1)];
            name.into_iter().chain([fixed(o.peak_speed_m_s, 3), fixed(o.speed_m_s, 4)]).collect()
        })
        .collect();
    page::section("Organ by organ", "", &table::plain(&head, &rows))
}
