//! The page of the study.

use super::data::{BEADS, Beads, bead};
use super::result::{ByStrain, CubeRow, GuessRow, TruthCubeResult};
use crate::Result;
use glam::DVec3;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, or_dash};

/// Colours of beads where they were seen, and where they are predicted.
const SEEN: [u8; 3] = [120, 126, 132];
const PREDICTED: [u8; 3] = [214, 84, 40];

pub(super) fn document(beads: &Beads, r: &TruthCubeResult) -> Result<Document> {
    let strains: Vec<&String> = beads.strains.iter().map(|strain| &strain.percent).collect();
    let lead = "Beads in a cube of silicone of 80 mm between two rough plates. The outermost layers of beads go where \
                they were seen, as cubic polynomials; the beads of the five inner layers are predicted. Distances \
                between where a bead is predicted and where it was seen. Noise: distance of the outer beads from the \
                polynomials. Mesh: median distance from where quadratic tetrahedra in cells of 10 mm put the bead, by \
                the same law and ratio.";
    let of = |by: &ByStrain, strain: &String| fixed(by.get(strain).copied().unwrap_or(f64::NAN), 2);
    let card = |strain: &&String| {
        let (straight, noise) = (of(&r.interpolation_error_mm, strain), of(&r.noise_mm, strain));
        let note = format!("{strain}% strain; straight columns {straight} mm, noise {noise} mm");
        Card::new("Median error", format!("{} mm", of(&r.median_bead_error_mm, strain)), note)
    };
    let mut section = Section::new("Beads", lead).cards(strains.iter().map(card));
    for (strain, predicted) in beads.strains.iter().zip(&r.predicted) {
        let title = format!("The middle section at {}% strain", strain.percent);
        let legend = page::legend([("seen", SEEN), ("predicted", PREDICTED)]);
        let plot = Plot {
            title: &title,
            x: "across (mm)",
            y: "height (mm)",
            lines: lines(&strain.at, predicted),
            ..Plot::default()
        };
        section = section.plot(&plot, &format!("<b>{title}.</b> Columns of beads.{legend}"))?;
    }
    let section = section.table(models(r, &strains)).table(guesses(r, &strains));
    Ok(Document::new("Truth Cube", "Measured beads in a compressed cube, and where tissue puts them").with(section))
}

/// The columns of beads of the middle section, as seen and as predicted.
fn lines(seen: &[DVec3], predicted: &[DVec3]) -> Vec<Line> {
    let point = |p: DVec3| (1e3 * p.x, 1e3 * p.z);
    let columns = |layers: std::ops::Range<usize>, places: &[DVec3], from: usize, color: [u8; 3]| -> Vec<Line> {
        let line = |column: usize| {
            let beads = layers.clone().map(|layer| bead(layer, BEADS / 2, column));
            Line::new(beads.map(|k| point(places[k - from])).collect(), color)
        };
        (0..BEADS).map(line).collect()
    };
    let inner = columns(1..BEADS - 1, predicted, bead(1, 0, 0), PREDICTED);
    columns(0..BEADS, seen, 0, SEEN).into_iter().chain(inner).collect()
}

/// The columns of every strain: median and root of the mean square.
fn columns(strains: &[&String]) -> Vec<String> {
    strains.iter().flat_map(|s| [format!("Median at {s}% (mm)"), format!("RMS at {s}% (mm)")]).collect()
}

fn values(strains: &[&String], median: &ByStrain, rms: &ByStrain) -> Vec<String> {
    let of = |by: &ByStrain, strain: &String| fixed(by.get(strain).copied().unwrap_or(f64::NAN), 3);
    strains.iter().flat_map(|s| [of(median, s), of(rms, s)]).collect()
}

fn models(r: &TruthCubeResult, strains: &[&String]) -> Table {
    let mesh = strains.iter().map(|s| format!("Mesh at {s}% (mm)"));
    let head = ["Elements", "Cell (mm)", "Nodes", "Law", "nu"].map(str::to_owned).into_iter();
    let head = head.chain(columns(strains)).chain(mesh);
    let row = |row: &CubeRow| {
        let model = [
            row.elements.clone(),
            fixed(row.cell_mm, 1),
            count(row.nodes),
            row.law.clone(),
            row.poisson_ratio.to_string(),
        ];
        let mesh = strains.iter().map(|s| or_dash(row.mesh_mm.get(*s).copied(), 3));
        model.into_iter().chain(values(strains, &row.median_mm, &row.rms_mm)).chain(mesh).collect()
    };
    Table::new(head, r.rows.iter().map(row).collect())
}

fn guesses(r: &TruthCubeResult, strains: &[&String]) -> Table {
    let head = std::iter::once("Guess".to_owned()).chain(columns(strains));
    let row = |row: &GuessRow| {
        std::iter::once(row.guess.clone()).chain(values(strains, &row.median_mm, &row.rms_mm)).collect()
    };
    Table::new(head, r.guesses.iter().map(row).collect())
}
