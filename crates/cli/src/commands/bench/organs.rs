//! `trocar bench organs`.

use crate::cli::OrgansBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{OrgansResult, Result, Timing};

pub fn run(arguments: &OrgansBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::OrgansBench {
        organs: (&arguments.organs).into(),
        schedule: arguments.schedule.name(),
        threads: arguments.threads,
        young_modulus: 1e3 * arguments.young,
        poisson_ratio: arguments.poisson,
        damped: arguments.damped,
        warm_up: arguments.frames / 4,
        frames: arguments.frames,
        settle: arguments.settle,
    };
    output::print(json, &bench.run(progress)?, text);
    Ok(())
}

fn text(r: &OrgansResult) -> String {
    let row = |name: &str, t: &Timing| {
        vec![
            name.to_owned(),
            format!("{:.2}", t.frame_ms_median),
            format!("{:.2}", t.frame_ms_worst),
            format!("{:.2}x", t.real_time_factor),
            format!("{:.0}", t.iterations_per_frame),
            t.inverted.to_string(),
            t.yielded_substeps.to_string(),
            t.fallbacks.to_string(),
        ]
    };
    let header =
        ["1/60 s frames", "median ms", "worst ms", "real time", "iterations", "inverted", "yielded", "fallbacks"];
    let percent = |e: f64| format!("{:.3}%", 100.0 * e);
    format!(
        "{}: {} organs, {} nodes, {} tets; schedule '{}' ({} substeps), {} threads, {} kernels ({} cores{})\n{}\n\
         sag {} off the static solution (mean {:.2} um) after {:.1} s, when the fastest node moves at {:.1e} m/s\n\
         tube {} off the oracle at frames 15, 30, 60; {} inverted, grasp yielded in {} substeps",
        r.mesh,
        r.organs,
        r.nodes,
        r.tets,
        r.schedule,
        r.substeps,
        r.threads,
        r.isa,
        r.machine.cores,
        r.machine.load.map_or(String::new(), |l| format!(", load {l:.1}")),
        output::table(
            &header,
            &[row(&format!("{} dragged", r.appendix), &r.drag), row("every organ shaken", &r.moving)]
        ),
        percent(r.static_sag_error),
        r.static_sag_um,
        r.settled_s,
        r.settled_speed_m_s,
        r.step_errors.map(percent).join(", "),
        r.tube_inverted,
        r.tube_yielded_substeps
    )
}
