//! `trocar experiment integrators`.

use crate::cli::IntegratorsExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_studies::{IntegratorsResult, Result};

pub fn run(arguments: &IntegratorsExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::IntegratorsExperiment {
        mesh: arguments.mesh.clone(),
        record: RecordOptions { frames: arguments.frames, seed: arguments.seed, ..RecordOptions::default() },
        seconds: arguments.seconds,
        undamped: arguments.undamped,
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &IntegratorsResult) -> String {
    let header =
        ["integrator", "settings", "peak m/s", "last m/s", "ended", "sag ratio", "sag error", "ms/frame", "paper"];
    let or_dash = |v: Option<String>| v.unwrap_or_else(|| "-".to_owned());
    let rows: Vec<Vec<String>> = r
        .integrators
        .iter()
        .map(|row| {
            vec![
                row.name.to_owned(),
                row.settings.clone(),
                format!("{:.2e}", row.peak_speed_m_s),
                format!("{:.2e}", row.last_speed_m_s),
                row.ended_at_s.map_or("bounded".into(), |t| format!("{t:.3} s")),
                or_dash(row.sag_ratio.map(|s| format!("{s:.2}"))),
                or_dash(row.sag_error.map(|e| format!("{:.2}%", 100.0 * e))),
                format!("{:.1}", row.frame_ms),
                row.paper.to_owned(),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for finding in &r.findings {
        out += &format!("\n{finding}");
    }
    out + &format!(
        "\n{}: {} elements; stable explicit step {:.1} us; true sag {:.4} mm; all of it in {:.0} s; report {}",
        r.specimen, r.tets, r.stable_step_us, r.sag_mm, r.seconds, r.report
    )
}
