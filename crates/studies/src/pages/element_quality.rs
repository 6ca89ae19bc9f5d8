//! The page of the element-quality experiment.

use super::grasp_designs::suspensions;
use crate::Result;
use crate::experiment::{Condition, ElementQualityResult, ElementQualityRow};
use trocar_report::colors;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed};

/// The groups of cases that are compared: condition, and whether the jaw force is in proportion to the modulus.
fn groups(r: &ElementQualityResult) -> Vec<(Condition, bool)> {
    let mut all = Vec::new();
    for row in &r.rows {
        if !all.contains(&(row.condition, row.scaled)) {
            all.push((row.condition, row.scaled));
        }
    }
    all
}

fn of(r: &ElementQualityResult, (condition, scaled): (Condition, bool)) -> Vec<&ElementQualityRow> {
    r.rows.iter().filter(|row| row.condition == condition && row.scaled == scaled).collect()
}

pub(super) fn body(r: &ElementQualityResult) -> Result<String> {
    let mut body = String::new();
    for group in groups(r) {
        body += &section(r, group)?;
    }
    Ok(body)
}

fn section(r: &ElementQualityResult, group: (Condition, bool)) -> Result<String> {
    let (condition, scaled) = group;
    let what = match condition {
        Condition::Cell => "The paper\u{2019}s cell, organs touching, a dynamic arm in its port",
        Condition::Appendix => "The appendix alone, lifted by an ideal arm without a port",
    };
    let force = match scaled {
        false => format!("the jaws press with {} N at all moduli", fixed(r.jaw_force_n, 2)),
        true => format!(
            "the jaws press with {} N at 12 kPa and in proportion at others, so that all are squeezed alike",
            fixed(r.jaw_force_n, 2)
        ),
    };
    let lead = format!(
        "{what}. The appendix ({} nodes, {} elements) is grasped in its middle and lifted, at five moduli ({force}), \
         with its far end pinned and with the lowest 42% of its nodes pinned besides. The paper: 170 to 180 of 8,072 \
         elements inverted at 15 mm; at 30 mm three of three runs diverged at 3 and 6 kPa, one of three at 12 and 24, \
         none at 48.",
        count(r.nodes),
        count(r.tets),
    );
    let rows = of(r, group);
    let inverted = rows.iter().map(|row| row.inverted_peak).max().unwrap_or(0);
    let diverged = rows.iter().filter(|row| row.diverged).count();
    let held = rows.iter().filter(|row| row.held).count();
    let smallest = rows.iter().map(|row| row.min_volume_ratio).fold(f64::INFINITY, f64::min);
    let sum = |k: usize| rows.iter().map(|row| row.suspensions[k]).sum();
    let cards = page::cards(&[
        Card::new("Inverted", count(inverted), "most in any frame of any case").met(inverted == 0),
        Card::new("Diverged", format!("{diverged} of {}", rows.len()), "cases").met(diverged == 0),
        Card::new("Held", format!("{held} of {}", rows.len()), "cases"),
        Card::new("Smallest volume", fixed(smallest, 3), "of an element over its volume at rest"),
        Card::new(
            "Suspensions",
            suspensions(&[sum(0), sum(1), sum(2)]),
            "contacts disabled / contacts of blades disabled / organs relaxed",
        ),
    ]);
    let mut pins: Vec<&str> = Vec::new();
    rows.iter().for_each(|row| {
        if !pins.contains(&row.pins.as_str()) {
            pins.push(&row.pins);
        }
    });
    let figures = pins.iter().map(|pins| volumes(&rows, pins)).collect::<Result<Vec<_>>>()?;
    let name = match condition {
        Condition::Cell => "in the whole cell",
        Condition::Appendix => "with the appendix alone",
    };
    let title = format!("Fig. 7(f) {name}{}", if scaled { ", jaw force in proportion to the modulus" } else { "" });
    let body = cards + &page::grid(Columns::Two, &figures) + &table(&rows);
    Ok(page::section(&title, &lead, &body))
}

/// Smallest volume ratio over modulus, a line for each design and lift.
fn volumes(rows: &[&ElementQualityRow], pins: &str) -> Result<String> {
    let mut series: Vec<(String, Line)> = Vec::new();
    for row in rows.iter().filter(|row| row.pins == pins) {
        let name = format!("{}, {} mm", row.design, fixed(row.lift_mm, 0));
        let point = (row.modulus_kpa, row.min_volume_ratio);
        match series.iter_mut().find(|s| s.0 == name) {
            Some((_, line)) => line.points.push(point),
            None => {
                let color = colors::organ(series.len());
                series.push((name, Line { points: vec![point], color, filled: false }));
            }
        }
    }
    let legend = page::legend(series.iter().map(|(name, line)| (name.as_str(), line.color)));
    let title = format!("smallest volume ratio, {pins}");
    let plot = Plot {
        title: &title,
        x: "Young's modulus [kPa]",
        y: "volume ratio [1]",
        lines: series.into_iter().map(|s| s.1).collect(),
        bands: vec![],
        show: vec![0.0],
        limits: vec![0.0],
        log_x: true,
        log_y: false,
    };
    let pins = page::escape(pins);
    let caption = format!(
        "<b>Smallest volume of an element</b> over its volume at rest, {pins} pinned; at 0 it is inverted.{legend}"
    );
    Ok(page::figure(&plot.svg()?, &caption))
}

fn table(rows: &[&ElementQualityRow]) -> String {
    let head = [
        "Design",
        "Pins",
        "Lift [mm]",
        "E [kPa]",
        "Jaws [N]",
        "Inverted",
        "Diverged",
        "Smallest volume",
        "Yielded substeps",
        "Follow ratio",
        "Slip [mm]",
        "Activation step [mm]",
        "Pull [N]",
        "Held",
        "Suspensions",
        "Remarks",
    ];
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let row = |row: &&ElementQualityRow| {
        let remarks = [
            row.divergence.clone(),
            row.why.clone().filter(|_| row.divergence.is_none()),
            (row.slipped > 0).then(|| format!("slid {} times", row.slipped)),
            row.torn.then(|| "torn".to_owned()),
        ];
        vec![
            row.design.clone(),
            row.pins.clone(),
            fixed(row.lift_mm, 0),
            fixed(row.modulus_kpa, 0),
            fixed(row.jaw_force_n, 2),
            count(row.inverted_peak),
            yes(row.diverged),
            fixed(row.min_volume_ratio, 3),
            count(row.yielded_substeps),
            fixed(row.follow_ratio, 3),
            fixed(row.slip_mm, 2),
            fixed(row.activation_step_mm, 2),
            fixed(row.peak_constraint_n, 2),
            yes(row.held),
            suspensions(&row.suspensions),
            remarks.into_iter().flatten().collect::<Vec<_>>().join("; "),
        ]
    };
    table::plain(&head, &rows.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use crate::experiment::made_up_element_quality;

    #[test]
    fn every_case_is_shown() {
        let result = made_up_element_quality();
        let html = super::body(&result).unwrap();
        assert_eq!(html.matches("<svg").count(), 2);
        assert_eq!(html.matches("<tr>").count(), result.rows.len() + 1);
        assert!(html.contains("far-end + band pinned") && html.contains("card bad"), "one case inverts");
    }
}
