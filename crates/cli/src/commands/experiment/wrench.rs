//! `trocar experiment wrench`.

use crate::cli::WrenchExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_robot::wrench::SensorNoise;
use trocar_studies::{Result, WrenchResult};

pub fn run(arguments: &WrenchExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::WrenchExperiment {
        poses: arguments.poses,
        tilt: arguments.tilt.to_radians(),
        runs: arguments.runs,
        noise: SensorNoise { force: arguments.force_noise, torque: arguments.torque_noise },
        seed: arguments.seed,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &WrenchResult) -> String {
    let header = ["parameter", "unit", "truth", "mean error", "spread", "predicted", "within 1.96"];
    let rows: Vec<Vec<String>> = r
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.name.to_owned(),
                p.unit.to_owned(),
                format!("{:.4}", p.truth),
                format!("{:.1e}", p.bias),
                format!("{:.2e}", p.spread),
                format!("{:.2e}", p.predicted),
                format!("{:.1}%", 100.0 * p.within),
            ]
        })
        .collect();
    let seen = r.seen_from_mn.map_or("is not seen".to_owned(), |f| format!("is seen from {f:.0} mN"));
    output::table(&header, &rows)
        + &format!(
            "\nweight {:.4} N, spread {:.2} mN, predicted {:.2} mN (paper {} N); {} poses, condition number {:.1}\n\
             {:.1}% of {} estimates within the predicted 95%; chi-squared {:.2} on the mean (10 is right), off its distribution by {:.3} (limit {:.3})\n\
             a touch {seen}; RMS error {:.1} mN tared, {:.1} mN not tared; report {}",
            r.weight_n,
            r.weight_spread_mn,
            r.weight_predicted_mn,
            r.paper_weight_n,
            r.poses,
            r.condition,
            100.0 * r.within_95,
            r.runs,
            r.mean_distance_squared,
            r.largest_difference,
            r.difference_limit,
            r.tared_error_mn,
            r.untared_error_mn,
            r.report
        )
}
