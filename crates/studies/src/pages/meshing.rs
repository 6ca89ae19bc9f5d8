//! The page of the meshing benchmark.

use crate::Result;
use crate::bench::{MeshingResult, MeshingRow};
use trocar_report::page::{self, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed, percent};

pub(super) fn body(result: &MeshingResult) -> Result<String> {
    let of = |series: &'static str| result.rows.iter().filter(move |r| r.series == series);
    let points = |f: &dyn Fn(&MeshingRow) -> f64| -> Vec<(f64, f64)> {
        let mut points: Vec<_> = of("size").filter(|r| r.tets > 0).map(|r| (r.tets as f64 / 1e3, f(r))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let plot = |title: &'static str, y: &'static str, points: Vec<(f64, f64)>| {
        let line = Line { points, color: trocar_report::colors::organ(0), filled: false };
        let x = "tetrahedra [thousands]";
        let plot = Plot {
            title,
            x,
            y,
            lines: vec![line],
            bands: vec![],
            show: vec![0.0],
            limits: vec![],
            log_x: false,
            log_y: false,
        };
        Ok::<_, crate::Error>(page::figure(&plot.svg()?, &format!("<b>{title}.</b>")))
    };
    let figures = [
        plot("Time over size", "time [s]", points(&|r| r.seconds))?,
        plot("Time per element", "time [\u{b5}s]", points(&|r| 1e-3 * r.ns_per_tet))?,
    ];
    let linear = result.linearity.map_or(String::new(), |ratio| {
        format!(" Time per element at the largest size over that at the smallest: {}.", fixed(ratio, 2))
    });
    let lead = format!("The lattice mesher on one surface, finer and finer, {} threads.{linear}", result.threads);
    Ok(page::section("Cost", &lead, &(page::grid(Columns::Two, &figures) + &rows(of("size"))))
        + &page::section(
            "Side by side",
            "One surface, one run each on the same machine. The lattice mesher at the default settings (2.2 mm, or about 50,000 \
             elements), TetGen at the paper's, fTetWild at its own; the time of the last two holds the start of their process.",
            &rows(of("peers")),
        ))
}

fn rows<'a>(rows: impl Iterator<Item = &'a MeshingRow>) -> String {
    let head = [
        "Surface",
        "Mesher",
        "Nodes",
        "Tetrahedra",
        "Time [s]",
        "[ns/tet]",
        "Dihedral min.",
        "median",
        "max.",
        "Inverted",
        "Edge [mm]",
        "Volume",
    ];
    let row = |r: &MeshingRow| match &r.failure {
        Some(why) => vec![r.surface.clone(), r.mesher.clone(), why.clone()],
        None => vec![
            r.surface.clone(),
            r.mesher.clone(),
            count(r.nodes),
            count(r.tets),
            fixed(r.seconds, 2),
            fixed(r.ns_per_tet, 0),
            format!("{}\u{b0}", fixed(r.min_dihedral_deg, 1)),
            format!("{}\u{b0}", fixed(r.median_dihedral_deg, 1)),
            format!("{}\u{b0}", fixed(r.max_dihedral_deg, 1)),
            count(r.inverted),
            fixed(r.median_edge_mm, 2),
            percent(r.volume_error, 2),
        ],
    };
    table::plain(&head, &rows.map(row).collect::<Vec<_>>())
}
