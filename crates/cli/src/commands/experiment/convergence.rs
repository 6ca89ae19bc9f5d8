//! `trocar experiment convergence`.

use crate::cli::ConvergenceExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{ConvergenceResult, OrganSource, Result};

pub fn run(arguments: &ConvergenceExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let all = trocar_studies::ConvergenceExperiment::default();
    let experiment = trocar_studies::ConvergenceExperiment {
        organs: arguments.mesh.clone().map_or(OrganSource::Analytic(arguments.tets), OrganSource::File),
        scenes: if arguments.scenes.is_empty() { all.scenes } else { arguments.scenes.clone() },
        young_moduli: arguments.young.iter().map(|e| 1e3 * e).collect(),
        poisson_ratios: arguments.poisson.clone(),
        most_iterations: arguments.iterations,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &ConvergenceResult) -> String {
    let header = ["scene", "E kPa", "nu", "schedule", "iterations", "ms", "rms um", "of displacement", "energy"];
    let mut rows = Vec::new();
    let mut failed = String::new();
    for case in &r.cases {
        for row in case.rows.iter().filter(|row| row.own) {
            rows.push(vec![
                case.scene.clone(),
                case.young_kpa.to_string(),
                case.poisson.to_string(),
                row.schedule.clone(),
                row.iterations.to_string(),
                format!("{:.3}", row.wall_ms),
                format!("{:.2e}", row.position_error_um),
                format!("{:.1e}", row.position_error),
                row.energy_error.map_or("-".into(), |e| format!("{e:.1e}")),
            ]);
        }
        if let Some(why) = &case.failure {
            failed += &format!("\n{} at {} kPa, nu {}: {why}", case.scene, case.young_kpa, case.poisson);
        }
    }
    format!(
        "one substep from one state against the oracle, {}, {} tets, each schedule with its own iterations\n{}{failed}\n{} of {} cases were there already; {:.0} s; report {}",
        r.mesh,
        r.tets,
        output::table(&header, &rows),
        r.reused,
        r.cases.len(),
        r.seconds,
        r.report
    )
}
