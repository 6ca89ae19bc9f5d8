//! `trocar experiment port-budget`.

use crate::cli::PortBudgetExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{PortBudgetResult, Result};

pub fn run(arguments: &PortBudgetExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::PortBudgetExperiment {
        hole: 1e-3 * arguments.hole,
        shaft: 1e-3 * arguments.shaft,
        thickness: 1e-3 * arguments.thickness,
        push: arguments.push,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

/// Every so many rows are printed.
const EVERY: usize = 10;

fn text(r: &PortBudgetResult) -> String {
    let header = ["tilt deg", "clearance mm", "measured", "against", "across", "least", "pushed mm"];
    let number = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .step_by(EVERY)
        .map(|row| {
            vec![
                format!("{:.1}", row.tilt_deg),
                format!("{:.3}", row.clearance_mm),
                number(row.measured_mm),
                number(row.measured_against_mm),
                number(row.measured_across_mm),
                number(row.measured_least_mm),
                format!("{:.3}", row.pushed_mm),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for s in &r.starts {
        out += &format!(
            "\n{} start at {} deg: {:.4} mm by the formula, {} measured (paper {:.2})",
            s.arm,
            s.tilt_deg,
            s.clearance_mm,
            s.measured_mm.map_or("-".to_owned(), |m| format!("{m:.4}")),
            s.paper_mm
        );
    }
    let degrees = |v: Option<f64>| v.map_or("none".to_owned(), |v| format!("{v:.2} deg"));
    out + &format!(
        "\nno clearance from {} by the formula, {} measured (paper about {}); report {}",
        degrees(r.limit_deg),
        degrees(r.measured_limit_deg),
        r.paper_limit_deg,
        r.report
    )
}
