//! `trocar experiment rollouts`.

use crate::cli::RolloutsExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{Result, RolloutsResult};

pub fn run(arguments: &RolloutsExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::RolloutsExperiment {
        scene: arguments.scene.clone(),
        phantoms: arguments.phantoms.clone(),
        rollouts: arguments.rollouts,
        seed: arguments.seed,
        jobs: arguments.jobs,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &RolloutsResult) -> String {
    let p = &r.paper;
    let or_dash = |v: Option<f64>, decimals: usize| v.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    let of = |n: usize, all: usize| format!("{n} of {all}");
    let row = |what: &str, here: String, paper: String| vec![what.to_owned(), here, paper];
    let rows = [
        row("attached", of(r.attached, r.rollouts), of(p.attached, p.rollouts)),
        row("held to the end", of(r.held_to_end, r.attached), of(p.held_to_end, p.attached)),
        row("lift, median mm", or_dash(r.lift_median_mm, 1), format!("{:.1}", p.lift_median_mm)),
        row("peak RCM, median mm", or_dash(r.rcm_peak_median_mm, 3), format!("{:.2}", p.rcm_peak_median_mm)),
        row("RCM under load, median mm", or_dash(r.rcm_loaded_median_mm, 4), "-".to_owned()),
        row("RCM within 3 mm", of(r.rcm_within_3_mm, r.attached), of(p.rcm_within_3_mm, p.attached)),
        row("RCM within 5 mm", of(r.rcm_within_5_mm, r.attached), of(p.rcm_within_5_mm, p.attached)),
    ];
    let policies: Vec<Vec<String>> = r
        .by_policy
        .iter()
        .map(|p| {
            vec![
                p.policy.clone(),
                of(p.passed, p.episodes),
                of(p.held_to_end, p.attached),
                or_dash(p.lift_median_mm, 1),
                or_dash(p.rcm_max_mm, 3),
                p.ends[3].to_string(),
            ]
        })
        .collect();
    format!(
        "{}\n{}\n{} of {} passed, {} diverged, {} inverted elements at worst, suspensions of physics {}/{}/{} (contacts, contacts of blades, organs relaxed); states {}\nreport {}",
        output::table(&["", "here", "paper"], &rows),
        output::table(&["controller", "passed", "held", "lift mm", "RCM max mm", "diverged"], &policies),
        r.passed,
        r.rollouts,
        r.diverged,
        r.inverted_peak,
        r.suspensions[0],
        r.suspensions[1],
        r.suspensions[2],
        r.hash,
        r.report
    )
}
