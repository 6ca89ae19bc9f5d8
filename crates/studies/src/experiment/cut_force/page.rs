//! The page of the force of scissors.

use super::result::{CutForceResult, CutRow};
use crate::Result;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, percent};

/// Bars of the two errors.
const BARS: [f64; 2] = [0.15, 0.10];

/// Colour of the closed form.
const FORM: [u8; 3] = [128, 128, 128];

/// Forces beyond this many times the largest of a run are left out of the closed form's line.
const SHOWN: f64 = 1.1;

pub(super) fn document(r: &CutForceResult) -> Result<Document> {
    let [from, to] = r.compared_rad;
    let lead = format!(
        "Scissors close through a slab of {} mm and through a tube across them. The force is what the jaws of the \
         cell feel, at the middle of the blades, {} mm from the pivot. The work is the torque integrated over the \
         angle; the area is that of the faces that opened, projected on the plane of the cut. On slabs the torque is \
         compared with the closed form from {} rad, where the cut is well in the slab, to {} rad, where blades count \
         as closed.",
        fixed(r.thickness_mm, 0),
        fixed(r.lever_mm, 1),
        fixed(from, 2),
        fixed(to, 2)
    );
    let section = Section::new("Force of scissors", lead).cards(cards(r)).figures([
        plot(
            r,
            "slab",
            "<b>Slab</b>: what the jaws felt, and Mahvash and Okamura's closed form once the blades meet it.",
        )?,
        plot(r, "tube", "<b>Tube</b> of 9 mm.")?,
    ]);
    Ok(Document::new("Force of scissors", "Torque and work of a cut beside the closed form")
        .with(section)
        .with(table(r)))
}

fn cards(r: &CutForceResult) -> [Card; 3] {
    let error = |name, value: f64, bar: f64, note: &str| {
        Card::new(name, percent(value, 1), format!("{note}; bar {}", percent(bar, 0))).met(value < bar)
    };
    let weak = &r.weak;
    let note = format!(
        "jaws of {} N on {} J/m2; closed form {} rad",
        weak.force_n,
        weak.toughness_j_m2,
        fixed(weak.closed_form_rad, 3)
    );
    [
        error("Torque on slabs", r.cut_force_error, BARS[0], "largest difference from the closed form"),
        error("Work", r.work_error, BARS[1], "largest difference from toughness times area"),
        Card::new("Weak jaws stand at", format!("{} rad", fixed(weak.stands_rad, 3)), note).met(!weak.cut),
    ]
}

fn plot(r: &CutForceResult, shape: &str, caption: &str) -> Result<String> {
    let rows: Vec<&CutRow> = r.rows.iter().filter(|row| row.shape == shape).collect();
    let mut lines = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        let degrees = |angle: f64| angle.to_degrees();
        let measured = row.samples.iter().map(|s| (degrees(s.angle_rad), s.force_n)).collect();
        lines.push(Line { points: measured, color: colors::organ(k), filled: false });
        let form = row.samples.iter().filter_map(|s| Some((degrees(s.angle_rad), s.closed_form_nm?)));
        let form = form.map(|(angle, nm)| (angle, nm / (1e-3 * r.lever_mm)));
        let form: Vec<(f64, f64)> = form.filter(|p| p.1 < SHOWN * row.force_peak_n).collect();
        // Plots have no other kind of line.
        lines.extend(form.chunks(2).map(|dash| Line::new(dash.to_vec(), FORM)));
    }
    let plot = Plot {
        title: "Force over opening",
        x: "angle of the blades (\u{b0})",
        y: "force at their middle (N)",
        lines,
        show: vec![0.0],
        ..Plot::default()
    };
    let names: Vec<String> = rows.iter().map(|row| format!("{} J/m\u{b2}", row.toughness_j_m2)).collect();
    let form = rows.iter().any(|row| row.force_error.is_some()).then_some(("closed form (dashes)", FORM));
    let legend = page::legend(names.iter().enumerate().map(|(k, n)| (n.as_str(), colors::organ(k))).chain(form));
    Ok(plot.figure(&format!("{caption}{legend}"))?)
}

fn table(r: &CutForceResult) -> Section {
    let table = Table::of(
        &r.rows,
        &[
            ("Tissue", &|row| row.shape.to_owned()),
            ("Toughness (J/m\u{b2})", &|row| fixed(row.toughness_j_m2, 0)),
            ("Largest force (N)", &|row| fixed(row.force_peak_n, 2)),
            ("Torque beside the closed form", &|row| {
                row.force_error.map_or("\u{2013}".to_owned(), |error| percent(error, 1))
            }),
            ("Work (mJ)", &|row| fixed(row.work_mj, 2)),
            ("Area (mm\u{b2})", &|row| fixed(row.section_mm2, 1)),
            ("of faces (mm\u{b2})", &|row| fixed(row.area_mm2, 1)),
            ("Work beside toughness times area", &|row| percent(row.work_error, 1)),
            ("Pieces", &|row| row.pieces.to_string()),
        ],
    );
    Section::new("Cuts", "").table(table)
}
