//! `trocar experiment element-quality`.

use crate::cli::ElementQualityExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{ElementQualityResult, ElementQualityRow, Result};

pub fn run(arguments: &ElementQualityExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::ElementQualityExperiment {
        appendix: (&arguments.appendix).into(),
        conditions: arguments.condition.conditions(),
        jaw_force: arguments.jaw_force,
        scaled: arguments.scaled_force,
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &ElementQualityResult) -> String {
    let header = [
        "condition",
        "design",
        "pins",
        "lift mm",
        "kPa",
        "jaws N",
        "inverted",
        "diverged",
        "least volume",
        "yielded",
        "follows",
        "slip mm",
        "step mm",
        "pull N",
        "held",
        "suspensions",
        "",
    ];
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let row = |row: &ElementQualityRow| {
        let [contacts, blades, relaxed] = row.suspensions;
        vec![
            row.condition.name().to_owned(),
            row.design.clone(),
            row.pins.clone(),
            format!("{:.0}", row.lift_mm),
            format!("{:.0}", row.modulus_kpa),
            format!("{:.2}", row.jaw_force_n),
            row.inverted_peak.to_string(),
            yes(row.diverged),
            format!("{:.3}", row.min_volume_ratio),
            row.yielded_substeps.to_string(),
            format!("{:.3}", row.follow_ratio),
            format!("{:.2}", row.slip_mm),
            format!("{:.2}", row.activation_step_mm),
            format!("{:.2}", row.peak_constraint_n),
            yes(row.held),
            format!("{contacts}/{blades}/{relaxed}"),
            row.why.clone().unwrap_or_default(),
        ]
    };
    let table = |scaled: bool| {
        let rows: Vec<Vec<String>> = r.rows.iter().filter(|c| c.scaled == scaled).map(row).collect();
        if rows.is_empty() { String::new() } else { output::table(&header, &rows) + "\n" }
    };
    let scaled = table(true);
    let scaled = if scaled.is_empty() { scaled } else { format!("jaw force in proportion to the modulus:\n{scaled}") };
    format!(
        "{}{scaled}the appendix: {} nodes, {} tets; jaws of {} N; {:.0} s{}; report {}",
        table(false),
        r.nodes,
        r.tets,
        r.jaw_force_n,
        r.seconds,
        super::resumed(&r.resumed, "cases"),
        r.report
    )
}
