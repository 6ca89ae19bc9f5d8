//! `trocar bench grasp`.

use crate::cli::GraspBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{GraspBenchResult, GraspPhaseTiming, Result};

pub fn run(arguments: &GraspBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::GraspBench {
        specimen: arguments.specimen.specimen.clone(),
        record: arguments.specimen.record(),
        design: arguments.design.into(),
        jaw_force: arguments.jaw_force,
        repeats: arguments.repeats,
        threads: arguments.threads,
    };
    output::print(json, &bench.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &GraspBenchResult) -> String {
    let header = [
        "phase",
        "frames",
        "contact ms",
        "same motion",
        "off mm",
        "nothing",
        "iterations",
        "worst ms",
        "own share",
        "contact's share",
    ];
    let row = |p: &GraspPhaseTiming| {
        let iterations = [p.with_contact_iterations, p.same_motion_iterations, p.without_contact_iterations];
        vec![
            p.phase.to_owned(),
            p.frames.to_string(),
            format!("{:.2}", p.with_contact_ms),
            format!("{:.2}", p.same_motion_ms),
            format!("{:.4}", p.same_motion_off_mm),
            format!("{:.2}", p.without_contact_ms),
            iterations.map(|n| format!("{n:.0}")).join("/"),
            format!("{:.2}", p.worst_ms),
            format!("{:.1}%", 100.0 * p.own_share),
            format!("{:.1}%", 100.0 * p.contact_share),
        ]
    };
    format!(
        "{}\nSame motion: every frame anew without contact but with its forces. Nothing: no contact, no forces.\n{:.2}x real time with contact, {:.2}x without; {} grasp, {}; {} organs, {} nodes, {} tets; {} threads on {} cores{}",
        output::table(&header, &r.phases.iter().map(row).collect::<Vec<_>>()),
        r.real_time_factor,
        r.real_time_factor_without_contact,
        r.design,
        if r.held { "held" } else { "NOT held" },
        r.organs,
        r.nodes,
        r.tets,
        r.threads,
        r.machine.cores,
        r.machine.load.map_or(String::new(), |l| format!(", load {l:.1}"))
    )
}
