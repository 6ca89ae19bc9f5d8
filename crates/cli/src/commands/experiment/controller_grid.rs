//! `trocar experiment controller-grid`.

use super::resumed;
use crate::cli::ControllerGridExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{ControllerGridResult, ControllerRow, Result};

/// Rows that are printed.
const BEST: usize = 10;

pub fn run(arguments: &ControllerGridExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::ControllerGridExperiment { threads: arguments.threads };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &ControllerGridResult) -> String {
    let header = [
        "controller",
        "rad/s",
        "damping",
        "correction",
        "RCM p95 mm",
        "tracking mm",
        "droop mm",
        "lag ms",
        "torque Nm",
    ];
    let mut best: Vec<&ControllerRow> = r.rows.iter().collect();
    best.sort_by(|a, b| a.share_of_bars().total_cmp(&b.share_of_bars()));
    let rows: Vec<Vec<String>> = best
        .into_iter()
        .take(BEST)
        .map(|row| {
            let f = &row.figures;
            vec![
                row.controller.clone(),
                format!("{:.0}", row.bandwidth),
                format!("{:.1}", row.damping),
                row.observer.or(row.integral).map_or("-".to_owned(), |v| format!("{v:.0}")),
                format!("{:.4}", f.rcm_p95_mm),
                format!("{:.4}", f.tracking_rms_mm),
                format!("{:.4}", f.droop_mm),
                format!("{:.2}", 1e3 * f.lag_s),
                format!("{:.1}", f.torque_peak),
            ]
        })
        .collect();
    let chosen = r.chosen.as_ref().map_or("none is chosen".to_owned(), |c| {
        let f = &c.figures;
        format!(
            "chosen: {} at {} rad/s, damping {}{}: p95 RCM {:.3} mm (paper {}), tracking {:.3} mm RMS (paper {}), droop {:.3} mm (paper {});\n\
             {:.1} ms behind the raw 30 Hz command, {:.2} mm RMS from it; {}",
            c.controller,
            c.bandwidth,
            c.damping,
            c.observer.or(c.integral).map_or(String::new(), |o| format!(", correction {o} rad/s")),
            f.rcm_p95_mm,
            r.bars.rcm_p95_mm,
            f.tracking_rms_mm,
            r.bars.tracking_rms_mm,
            f.droop_mm,
            r.bars.droop_mm,
            1e3 * f.command_lag_s,
            f.command_rms_mm,
            if r.chosen_is_default { "the default" } else { "NOT the default" }
        )
    });
    output::table(&header, &rows)
        + &format!(
            "\n{chosen}\n{} of {} stable, {} within all bars; {:.0} s{}; report {}",
            r.stable,
            r.rows.len(),
            r.within_bars,
            r.seconds,
            resumed(&r.resumed, "configurations"),
            r.report
        )
}
