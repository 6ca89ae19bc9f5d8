//! The page of the study.

use super::result::{Errors, MeshConvergenceResult, MeshRow};
use crate::Result;
use crate::trials::resumed;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};

/// Greatest error of the default tissue's sag and of its local pull.
const MAX_SAG_ERROR: f64 = 0.05;
const MAX_PULL_ERROR: f64 = 0.15;

/// Kinds of elements that come in several sizes.
const SIZED: [&str; 2] = ["linear", "lattice"];

type Value = fn(&Errors) -> f64;

const CASES: [(&str, Value); 4] =
    [("Sag", |e| e.sag), ("Lift", |e| e.lift), ("Pull", |e| e.pull), ("Grasp-lift", |e| e.grasp)];

pub(super) fn document(r: &MeshConvergenceResult) -> Result<Document> {
    let lead = format!(
        "An appendix of {} nodes and {} elements at rest, by several kinds and sizes of elements. The body is the \
         appendix's mesh: finer elements divide it, lattices are cut from it, coarser meshes are made from its \
         surface. A lattice of 16 cells along the longest axis is as coarse as the paper's hexahedra. The reference is \
         quadratic tetrahedra. An error below 0 is a body that is too stiff. Sag: held by its base under a hundredth \
         of its weight; mean displacement. Lift: the same, a patch of 5 mm lifted by 2 mN. Pull: the lowest 42% held, \
         a patch of 5 mm pulled up by 0.1 N, at three places; the worst. Grasp-lift: the force that lifts the grasped \
         middle by 8 mm. Every kind has the same law and is solved by Newton's method in double precision.",
        count(r.nodes),
        count(r.tets)
    );
    let cards = [
        Card::new("Sag", percent(r.default_sag_error, 1), "greatest error of the default tissue; 5% at most")
            .met(r.default_sag_error <= MAX_SAG_ERROR),
        Card::new("Local pull", percent(r.default_pull_error, 1), "greatest error of the default tissue; 15% at most")
            .met(r.default_pull_error <= MAX_PULL_ERROR),
        Card::new("Sag, corrected", percent(r.corrected_sag_error, 1), "with mesh_correction"),
        Card::new("Local pull, corrected", percent(r.corrected_pull_error, 1), "with mesh_correction"),
        Card::new("Lift", percent(r.default_lift_error, 1), "greatest error of the default tissue"),
        Card::new("Grasp-lift", percent(r.default_grasp_error, 1), "greatest error of the default tissue"),
    ];
    let mut ratios: Vec<f64> = r.rows.iter().map(|row| row.nu).collect();
    ratios.dedup();
    let mut section = Section::new("Error of the mesh", lead).cards(cards);
    for (title, value) in CASES {
        section = plot(r, section, title, value, &ratios)?;
    }
    Ok(Document::new("Mesh convergence", "Deflections of an appendix over the size of its elements")
        .with(section.table(table(r)).lines(resumed(&r.resumed, "row"))))
}

fn plot(r: &MeshConvergenceResult, section: Section, title: &str, value: Value, ratios: &[f64]) -> Result<Section> {
    let mut series: Vec<(String, Line)> = Vec::new();
    for kind in SIZED {
        for nu in ratios {
            let rows = r.rows.iter().zip(&r.errors).filter(|(row, _)| row.method == kind && row.nu == *nu);
            let mut points: Vec<(f64, f64)> = rows.map(|(row, e)| (row.edge_mm, 100.0 * value(e))).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            series.push((format!("{kind}, {nu}"), Line::new(points, colors::organ(series.len()))));
        }
    }
    let mut legend: Vec<(&str, [u8; 3])> = series.iter().map(|(name, line)| (name.as_str(), line.color)).collect();
    let color = colors::organ(series.len());
    legend.push(("default tissue, each ratio", color));
    let legend = page::legend(legend);
    let mut lines: Vec<Line> = series.into_iter().map(|(_, line)| line).collect();
    let default = r.rows.iter().zip(&r.errors).filter(|(row, _)| row.method == "default");
    lines.extend(default.map(|(row, e)| Line::new(vec![(row.edge_mm, 100.0 * value(e))], color)));
    let plot =
        Plot { title, x: "edge (mm)", y: "error (%)", lines, show: vec![0.0], limits: vec![0.0], ..Plot::default() };
    Ok(section.plot(&plot, &format!("<b>{title}</b>: error against the body, by kind and Poisson's ratio.{legend}"))?)
}

fn table(r: &MeshConvergenceResult) -> Table {
    let rows: Vec<(&MeshRow, &Errors)> = r.rows.iter().zip(&r.errors).collect();
    Table::of(
        rows,
        &[
            ("Elements", &|(row, _)| row.method.clone()),
            ("Edge (mm)", &|(row, _)| fixed(row.edge_mm, 2)),
            ("Nodes", &|(row, _)| count(row.nodes)),
            ("nu", &|(row, _)| row.nu.to_string()),
            ("Sag (mm)", &|(row, _)| fixed(row.cases.sag_mm, 3)),
            ("Error", &|(_, e)| percent(e.sag, 1)),
            ("Lift (mm)", &|(row, _)| fixed(row.cases.lift_mm, 3)),
            ("Error", &|(_, e)| percent(e.lift, 1)),
            ("Pull (mm)", &|(row, _)| row.cases.pull_mm.iter().map(|u| fixed(*u, 3)).collect::<Vec<_>>().join(", ")),
            ("Worst", &|(_, e)| percent(e.pull, 1)),
            ("Grasp (N)", &|(row, _)| fixed(row.cases.grasp_n, 4)),
            ("Compliance", &|(_, e)| percent(e.grasp, 1)),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::mesh_convergence::result::Cases;
    use crate::trials::Resumed;

    /// Rows whose deflections are a share below those of the reference.
    fn made_up(default_error: f64) -> MeshConvergenceResult {
        let row = |method: &str, edge_mm: f64, share: f64| MeshRow {
            method: method.to_owned(),
            edge_mm,
            nodes: 100,
            nu: 0.45,
            cases: Cases {
                sag_mm: 3.0 * share,
                lift_mm: 10.0 * share,
                pull_mm: vec![1.2 * share, 1.1 * share],
                grasp_n: 0.006 / share,
            },
        };
        let rows = vec![
            row("quadratic", 2.0, 1.0),
            row("default", 2.0, 1.0 - default_error),
            row("linear", 2.0, 0.85),
            row("linear", 3.0, 0.7),
            row("lattice", 3.0, 0.8),
        ];
        MeshConvergenceResult::from_rows(rows, (100, 300), Resumed::default()).unwrap()
    }

    #[test]
    fn errors_are_against_the_reference() {
        let result = made_up(0.2);
        for error in [result.default_sag_error, result.default_pull_error, result.default_lift_error] {
            assert!((error - 0.2).abs() < 1e-12);
        }
        assert!((result.errors[2].grasp + 0.15).abs() < 1e-12, "{}", result.errors[2].grasp);
        let html = document(&result).unwrap().page();
        assert_eq!(html.matches("<svg").count(), CASES.len());
        assert_eq!(html.matches("card bad").count(), 2, "sag and pull are out of bounds");
        assert!(!document(&made_up(0.02)).unwrap().page().contains("card bad"));
    }

    #[test]
    fn without_the_reference_there_is_no_error() {
        let mut rows = made_up(0.1).rows;
        rows.remove(0);
        assert!(MeshConvergenceResult::from_rows(rows, (1, 1), Resumed::default()).is_err());
    }
}
