//! `trocar experiment random-actions`.

use crate::cli::RandomActionsExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{RandomActionsResult, Result};

pub fn run(arguments: &RandomActionsExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::RandomActionsExperiment {
        scene: arguments.scene.clone(),
        phantoms: arguments.phantoms.clone(),
        first_seed: arguments.first_seed,
        seeds: arguments.seeds,
        actions: arguments.actions,
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &RandomActionsResult) -> String {
    let header = [
        "seed",
        "actions",
        "inverted",
        "stretch",
        "least volume",
        "rcm mm",
        "force N",
        "contacts disabled",
        "of blades",
        "relaxed",
        "guarded",
    ];
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .map(|row| {
            vec![
                row.seed.to_string(),
                row.actions.to_string(),
                row.inverted_peak.to_string(),
                format!("{:.2}", row.max_stretch),
                format!("{:.4}", row.min_volume_ratio),
                format!("{:.2}", row.rcm_max_mm),
                format!("{:.2}", row.force_max_n),
                row.disabled_contacts.to_string(),
                row.disabled_blades.to_string(),
                row.relaxed.to_string(),
                row.guarded.to_string(),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for row in &r.rows {
        if let Some(why) = &row.diverged {
            out += &format!("\nseed {} after {} actions: {why}", row.seed, row.actions);
        }
    }
    let said = if r.unbroken { "nothing broke" } else { "BROKEN" };
    let resumed = super::resumed(&r.resumed, "seeds");
    out + &format!("\n{} actions, {said}; {:.0} s{resumed}; report {}", r.actions, r.seconds, r.report)
}
