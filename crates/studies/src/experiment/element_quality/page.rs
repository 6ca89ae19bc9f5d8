//! The page of the element-quality study.

use super::result::{ElementQualityResult, ElementQualityRow};
use crate::Result;
use crate::experiment::appendix::{Condition, remarks};
use crate::trials::resumed;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, or_dash, yes_or_no};
use trocar_task::Warnings;

pub(super) fn document(r: &ElementQualityResult) -> Result<Document> {
    // Groups of cases: condition, and whether the jaw force is proportional to the modulus.
    let mut groups: Vec<(Condition, bool)> = r.rows.iter().map(|row| (row.condition, row.scaled)).collect();
    groups.dedup();
    let mut document = Document::new("Element quality", "Lifts of the appendix against its pins");
    for group in groups {
        document = document.with(section(r, group)?);
    }
    let appendix = format!(
        "Appendix: {} nodes, {} elements; jaw force {} N.",
        count(r.nodes),
        count(r.tets),
        fixed(r.jaw_force_n, 2)
    );
    let lines = std::iter::once(appendix).chain(resumed(&r.resumed, "case"));
    Ok(document.with(Section::new("Settings", "").lines(lines)))
}

fn section(r: &ElementQualityResult, (condition, scaled): (Condition, bool)) -> Result<Section> {
    let rows: Vec<&ElementQualityRow> =
        r.rows.iter().filter(|row| (row.condition, row.scaled) == (condition, scaled)).collect();
    let force = if scaled { "N at 12 kPa and in proportion at other moduli" } else { "N at all moduli" };
    let lead = format!(
        "{}. The appendix is grasped in its middle and lifted, at five moduli. The jaw force is {} {force}. The far \
         end is pinned; in half of the cases also the lowest 42% of the nodes. Paper: 170 to 180 of 8,072 elements \
         inverted at 15 mm; at 30 mm three of three runs diverged at 3 and 6 kPa, one of three at 12 and 24 kPa, \
         none at 48 kPa.",
        condition.described(),
        fixed(r.jaw_force_n, 2),
    );
    let inverted = rows.iter().map(|row| row.inverted_peak).max().unwrap_or(0);
    let diverged = rows.iter().filter(|row| row.diverged).count();
    let held = rows.iter().filter(|row| row.held).count();
    let smallest = rows.iter().map(|row| row.min_volume_ratio).fold(f64::INFINITY, f64::min);
    let warnings: Warnings = rows.iter().map(|row| row.warnings).sum();
    let cards = [
        Card::new("Inverted", count(inverted), "largest number in any frame of any case").met(inverted == 0),
        Card::new("Diverged", format!("{diverged} of {}", rows.len()), "cases").met(diverged == 0),
        Card::new("Held", format!("{held} of {}", rows.len()), "cases"),
        Card::new("Smallest volume", fixed(smallest, 3), "of an element over its volume at rest"),
        Card::new("Warnings", warnings.to_string(), Warnings::LEGEND),
    ];
    let mut pins: Vec<&str> = rows.iter().map(|row| row.pins.as_str()).collect();
    pins.sort_unstable();
    pins.dedup();
    let figures = pins.iter().map(|pins| volumes(&rows, pins)).collect::<Result<Vec<_>>>()?;
    let scaled = if scaled { ", jaw force proportional to the modulus" } else { "" };
    let title = format!("Fig. 7(f) {}{scaled}", condition.title());
    Ok(Section::new(title, lead).cards(cards).figures(figures).table(table(&rows)))
}

/// Smallest volume ratio over modulus, one line per design and lift.
fn volumes(rows: &[&ElementQualityRow], pins: &str) -> Result<String> {
    let mut series: Vec<(String, Line)> = Vec::new();
    for row in rows.iter().filter(|row| row.pins == pins) {
        let name = format!("{}, {} mm", row.design, fixed(row.lift_mm, 0));
        let point = (row.modulus_kpa, row.min_volume_ratio);
        match series.iter_mut().find(|s| s.0 == name) {
            Some((_, line)) => line.points.push(point),
            None => series.push((name, Line::new(vec![point], colors::organ(series.len())))),
        }
    }
    let legend = page::legend(series.iter().map(|(name, line)| (name.as_str(), line.color)));
    let title = format!("smallest volume ratio, {pins}");
    let plot = Plot {
        title: &title,
        x: "Young's modulus (kPa)",
        y: "volume ratio (1)",
        lines: series.into_iter().map(|s| s.1).collect(),
        show: vec![0.0],
        limits: vec![0.0],
        log_x: true,
        ..Plot::default()
    };
    let pins = page::escape(pins);
    let caption = format!(
        "<b>Smallest volume of an element</b> over its volume at rest, {pins} pinned; at 0 it is inverted.{legend}"
    );
    Ok(plot.figure(&caption)?)
}

fn table(rows: &[&ElementQualityRow]) -> Table {
    Table::of(
        rows,
        &[
            ("Design", &|r| r.design.clone()),
            ("Condition", &|r| r.condition.name().to_owned()),
            ("Pins", &|r| r.pins.clone()),
            ("Lift (mm)", &|r| fixed(r.lift_mm, 0)),
            ("E (kPa)", &|r| fixed(r.modulus_kpa, 0)),
            ("Jaws (N)", &|r| fixed(r.jaw_force_n, 2)),
            ("Inverted", &|r| count(r.inverted_peak)),
            ("Diverged", &|r| yes_or_no(r.diverged)),
            ("Smallest volume", &|r| fixed(r.min_volume_ratio, 3)),
            ("Yielded substeps", &|r| count(r.yielded_substeps)),
            ("Follow ratio", &|r| or_dash(r.follow_ratio, 3)),
            ("Slip (mm)", &|r| or_dash(r.slip_mm, 2)),
            ("Activation step (mm)", &|r| or_dash(r.activation_step_mm, 2)),
            ("Pull (N)", &|r| or_dash(r.peak_constraint_n, 2)),
            ("Held", &|r| yes_or_no(r.held)),
            ("Warnings", &|r| r.warnings.to_string()),
            ("Remarks", &|r| remarks(r.divergence.as_ref(), r.why.as_ref(), (r.slipped, r.torn), None)),
        ],
    )
}
