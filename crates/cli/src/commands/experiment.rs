//! `trocar experiment`.

mod controller_grid;
mod convergence;
mod element_quality;
mod grasp_designs;
mod integrators;
mod port_budget;
mod random_actions;
mod rollouts;
mod settling;
mod similarity;
mod wrench;

use crate::cli::{Experiment, ExperimentName, ReconstructionExperiment};
use crate::output;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::Settings;
use trocar_studies::{ReconstructionResult, Result, Resumed};

pub fn run(arguments: &Experiment, json: bool, progress: &dyn Progress) -> Result<()> {
    match &arguments.name {
        ExperimentName::Convergence(arguments) => convergence::run(arguments, json, progress),
        ExperimentName::Integrators(arguments) => integrators::run(arguments, json, progress),
        ExperimentName::GraspDesigns(arguments) => grasp_designs::run(arguments, json, progress),
        ExperimentName::ElementQuality(arguments) => element_quality::run(arguments, json, progress),
        ExperimentName::PortBudget(arguments) => port_budget::run(arguments, json, progress),
        ExperimentName::ControllerGrid(arguments) => controller_grid::run(arguments, json, progress),
        ExperimentName::Wrench(arguments) => wrench::run(arguments, json, progress),
        ExperimentName::RandomActions(arguments) => random_actions::run(arguments, json, progress),
        ExperimentName::Rollouts(arguments) => rollouts::run(arguments, json, progress),
        ExperimentName::Settling(arguments) => settling::run(arguments, json, progress),
        ExperimentName::Similarity(arguments) => similarity::run(arguments, json, progress),
        ExperimentName::Reconstruction(arguments) => reconstruction(arguments, json, progress),
    }
}

/// What was taken from an earlier run, in words that follow a time.
fn resumed(resumed: &Resumed, what: &str) -> String {
    let earlier = match resumed.trials {
        0 => String::new(),
        n => format!(", {n} {what} taken from an earlier run"),
    };
    earlier + &resumed.put_aside.as_ref().map_or(String::new(), |why| format!("; {why}"))
}

fn reconstruction(arguments: &ReconstructionExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let named = &arguments.phantoms;
    let experiment = trocar_studies::ReconstructionExperiment {
        phantoms: if named.is_empty() {
            trocar_phantom::NAMES.iter().map(|n| (*n).to_owned()).collect()
        } else {
            named.clone()
        },
        record: RecordOptions { frames: arguments.frames, seed: arguments.seed, sensor: arguments.sensor.into() },
        settings: Settings { back: arguments.back.into(), mesher: arguments.mesher.into(), ..Settings::default() },
    };
    let result = experiment.run(&arguments.output, progress)?;
    output::print(json, &result, text);
    Ok(())
}

fn text(r: &ReconstructionResult) -> String {
    let header = [
        "organ",
        "nodes",
        "(paper)",
        "tets",
        "(paper)",
        "min dih deg",
        "closed",
        "inverted",
        "|err| mm",
        "err mm",
        "binary grid",
        "covered",
        "cm3",
        "off model",
        "off truth",
    ];
    let paper = |n: Option<usize>| n.map_or(String::new(), |n| format!("({n})"));
    let rows: Vec<Vec<String>> = r
        .organs
        .iter()
        .map(|o| {
            vec![
                format!("{} {}", o.phantom.trim_start_matches("phantom-").to_uppercase(), o.organ),
                o.nodes.to_string(),
                paper(o.paper_nodes),
                o.tets.to_string(),
                paper(o.paper_tets),
                format!("{:.1}", o.min_dihedral_deg),
                if o.watertight { "yes" } else { "NO" }.to_owned(),
                o.inverted.to_string(),
                format!("{:.2}", o.depth_error_median_mm),
                format!("{:.2}", o.signed_error_median_mm),
                o.binary_grid_signed_error_mm.map_or("-".into(), |e| format!("{e:.2}")),
                format!("{:.2}", o.covered),
                format!("{:.2}", o.volume_cm3),
                format!("{:+.1}%", 100.0 * o.volume_error),
                format!("{:+.0}%", 100.0 * o.volume_error_truth),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for p in &r.phantoms {
        let c = &p.composite;
        out += &format!(
            "\n{}: {} frames, {:.1}% recovered from under instruments, depth on {:.1}%, median range {:.2} mm",
            p.phantom,
            c.frames_used,
            100.0 * c.recovered_share,
            100.0 * c.coverage,
            c.depth_range_median_mm
        );
        if let Some(t) = &c.truth {
            out += &format!(
                "; composite against truth {:.2} mm, {} mm under instruments",
                t.depth_error_median_mm,
                t.under_instruments_median_mm.map_or("-".to_owned(), |e| format!("{e:.2}"))
            );
        }
        out += &format!("; {:.1} s", p.seconds);
    }
    out + &format!("\nall of it in {:.0} s; report {}", r.seconds, r.report)
}
