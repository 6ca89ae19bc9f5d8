//! `trocar bench cell`.

use crate::cli::CellBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{CellBenchResult, Result};

pub fn run(arguments: &CellBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::CellBench {
        scene: arguments.scene.clone(),
        specimen: arguments.specimen.clone(),
        phantoms: arguments.phantoms.clone(),
        threads: arguments.threads,
    };
    output::print(json, &bench.run(progress)?, text);
    Ok(())
}

fn text(r: &CellBenchResult) -> String {
    format!(
        "{:.2}x real time ({:.2}x if organs passed through each other): {:.2} ms a period of {:.1}: arms {:.2}, contact of organs {:.2}, tissue {:.2}, rest {:.2}; median {:.2}, worst {:.2}\n\
         {} periods, {} organs, {} nodes, {} tets; the lift {}; {} threads on {} cores{}",
        r.real_time_factor,
        r.real_time_factor_without_organ_contact,
        r.arms_ms + r.contact_ms + r.tissue_ms + r.rest_ms,
        r.period_ms,
        r.arms_ms,
        r.contact_ms,
        r.tissue_ms,
        r.rest_ms,
        r.median_ms,
        r.worst_ms,
        r.periods,
        r.organs,
        r.nodes,
        r.tets,
        if r.attached { "held" } else { "did NOT hold" },
        r.threads,
        r.machine.cores,
        r.machine.load.map_or(String::new(), |l| format!(", load {l:.1}"))
    )
}
