//! The page of the study.

use super::result::BeamResult;
use super::swing::{Swing, Track};
use crate::Result;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};

/// Greatest errors of the displacement at rest and of the period.
const MAX_DISPLACEMENT_ERROR: f64 = 0.12;
const MAX_PERIOD_ERROR: f64 = 0.1;

/// Colours of recordings and simulations.
const SEEN: [u8; 3] = [120, 126, 132];
const SIMULATED: [u8; 3] = [214, 84, 40];

/// Part of a track that is drawn (s).
const SHOWN_S: f64 = 1.2;

pub(super) fn document(r: &BeamResult, tracks: [(&Vec<Track>, &Track); 2]) -> Result<Document> {
    let lead = format!(
        "A beam of silicone of 30 x 30 x 100 mm, clamped at one end, is let go with a weight on the other end. Young's \
         modulus and viscosity are fitted to one load; the other is predicted by the solver of the cell, with {} nodes \
         and substeps of {} ms. The authors of the recordings fitted 263.8 kPa with their own simulator.",
        count(r.nodes),
        fixed(r.substeps.last().map_or(f64::NAN, |row| row.substep_ms), 2)
    );
    let cards = [
        Card::new("Displacement", percent(r.displacement_error, 1), "error of the predicted one; 12% at most")
            .met(r.displacement_error <= MAX_DISPLACEMENT_ERROR),
        Card::new("Period", percent(r.period_error, 1), "error of the predicted one; 10% at most")
            .met(r.period_error <= MAX_PERIOD_ERROR),
        Card::new("Young's modulus", format!("{} kPa", fixed(1e-3 * r.young_modulus, 1)), "fitted"),
        Card::new("Shear viscosity", format!("{} Pa s", fixed(r.viscosity, 0)), "fitted"),
    ];
    let mut section = Section::new("Swing", lead).cards(cards);
    for (case, (seen, simulated)) in r.cases.iter().zip(tracks) {
        let title = format!("{} N, {}", fixed(case.load_n, 2), case.case);
        let legend = page::legend([("recorded", SEEN), ("simulated", SIMULATED)]);
        let lines = seen.iter().map(|track| line(track, SEEN)).chain([line(simulated, SIMULATED)]).collect();
        let plot = Plot { title: &title, x: "time (s)", y: "displacement (mm)", lines, ..Plot::default() };
        section = section.plot(&plot, &format!("<b>{title}.</b> The end of the beam.{legend}"))?;
    }
    Ok(Document::new("Beam", "A beam of silicone that swings, and the same beam of tissue")
        .with(section.table(cases(r)))
        .with(
            Section::new(
                "Numerical damping",
                "Implicit Euler damps by itself, the more the longer a substep is. The default schedule has two \
                 substeps in a frame of 1/60 s.",
            )
            .table(substeps(r)),
        ))
}

fn line(track: &Track, color: [u8; 3]) -> Line {
    let points = track.places.iter().enumerate().map(|(k, d)| (track.step * k as f64, 1e3 * d));
    Line::new(points.take_while(|(t, _)| *t <= SHOWN_S).collect(), color)
}

fn values(swing: &Swing) -> [String; 4] {
    [fixed(swing.settled_mm, 2), fixed(swing.first_peak_mm, 2), fixed(1e3 * swing.period_s, 1), fixed(swing.damping, 3)]
}

const COLUMNS: [&str; 4] = ["At rest (mm)", "First peak (mm)", "Period (ms)", "Damping ratio"];

fn cases(r: &BeamResult) -> Table {
    let mut rows = Vec::new();
    for case in &r.cases {
        for (name, swing) in [("recorded", &case.measured), ("simulated", &case.simulated)] {
            let start = [case.case.to_owned(), fixed(case.load_n, 2), name.to_owned()];
            rows.push(start.into_iter().chain(values(swing)).collect());
        }
    }
    Table::new(["Case", "Load (N)", ""].into_iter().chain(COLUMNS), rows)
}

fn substeps(r: &BeamResult) -> Table {
    let row = |row: &super::result::SubstepRow| {
        let name = if row.is_default { "default schedule" } else { "" };
        let start = [fixed(row.substep_ms, 2), name.to_owned()];
        start.into_iter().chain(values(&row.simulated)).collect()
    };
    Table::new(["Substep (ms)", ""].into_iter().chain(COLUMNS), r.substeps.iter().map(row).collect())
}
