//! `trocar bench episode`.

use crate::cli::EpisodeBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{EpisodeBenchResult, Result};

pub fn run(arguments: &EpisodeBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::EpisodeBench {
        scene: arguments.scene.clone(),
        phantoms: arguments.phantoms.clone(),
        threads: arguments.threads,
        runs: arguments.runs,
        seed: arguments.seed,
        cameras: arguments.cameras.clone(),
        size: arguments.size,
    };
    output::print(json, &bench.run(progress)?, text);
    Ok(())
}

fn text(r: &EpisodeBenchResult) -> String {
    format!(
        "{:.2}x real time (bar {}), runs {}: {:.2} ms a period of {:.1}: arms {:.2}, tissue {:.2}, pictures {:.2}, rest {:.2}\n\
         {:.1} s simulated, {}, {} periods, {} organs, {} nodes; {} at {} x {}; {} threads on {} cores{}",
        r.real_time_factor,
        r.bar,
        r.run_factors.iter().map(|f| format!("{f:.2}")).collect::<Vec<_>>().join(" "),
        r.arms_ms + r.tissue_ms + r.pictures_ms + r.rest_ms,
        r.period_ms,
        r.arms_ms,
        r.tissue_ms,
        r.pictures_ms,
        r.rest_ms,
        r.simulated_s,
        r.end,
        r.periods,
        r.organs,
        r.nodes,
        r.cameras.join(", "),
        r.size,
        r.size,
        r.threads,
        r.machine.cores,
        r.machine.load.map_or(String::new(), |l| format!(", load {l:.1}"))
    ) + if r.repeatable { "" } else { "; the runs ended in DIFFERENT states" }
}
