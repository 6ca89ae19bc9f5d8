//! `trocar experiment element-quality`.

use crate::cli::ElementQualityExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{ElementQualityResult, ElementQualityRow, Result};

pub fn run(arguments: &ElementQualityExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::ElementQualityExperiment {
        appendix: (&arguments.appendix).into(),
        jaw_force: arguments.jaw_force,
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &ElementQualityResult) -> String {
    let header = [
        "design",
        "pins",
        "lift mm",
        "kPa",
        "inverted",
        "diverged",
        "least volume",
        "yielded",
        "follows",
        "slip mm",
        "pull N",
        "held",
        "",
    ];
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let row = |row: &ElementQualityRow| {
        vec![
            row.design.clone(),
            row.pins.clone(),
            format!("{:.0}", row.lift_mm),
            format!("{:.0}", row.modulus_kpa),
            row.inverted_peak.to_string(),
            yes(row.diverged),
            format!("{:.3}", row.min_volume_ratio),
            row.yielded_substeps.to_string(),
            format!("{:.3}", row.follow_ratio),
            format!("{:.2}", row.slip_mm),
            format!("{:.2}", row.peak_constraint_n),
            yes(row.held),
            if !row.attached {
                "nothing in the mouth"
            } else if row.torn {
                "torn"
            } else if row.slipped > 0 {
                "slid"
            } else {
                ""
            }
            .to_owned(),
        ]
    };
    format!(
        "{}\nappendix alone, {} nodes, {} tets; jaws of {} N; {:.0} s{}; report {}",
        output::table(&header, &r.rows.iter().map(row).collect::<Vec<_>>()),
        r.nodes,
        r.tets,
        r.jaw_force_n,
        r.seconds,
        super::resumed(&r.resumed, "cases"),
        r.report
    )
}
