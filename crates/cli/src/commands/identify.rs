//! `trocar identify`.

use crate::cli::Identify;
use crate::output;
use trocar_core::Progress;
use trocar_workflow::identify::{IdentifyResult, Identifying};
use trocar_workflow::{Result, counted};

pub fn run(arguments: &Identify, json: bool, progress: &dyn Progress) -> Result<()> {
    let identifying = Identifying {
        recording: arguments.recording.clone(),
        specimen: arguments.specimen.clone(),
        organ: arguments.organ.clone(),
        lifts: arguments.lifts.clone(),
        cell: 1e-3 * arguments.cell,
        seed: arguments.seed,
        threads: arguments.threads,
    };
    let result = identifying.run(&arguments.output, progress)?;
    output::print(json, &result, text);
    Ok(())
}

fn text(r: &IdentifyResult) -> String {
    let mut lines = vec![
        format!(
            "{}: {} with {} seen; {} values simulated on {} nodes, {} diverged",
            r.organ,
            counted(r.lifts.len(), "lift"),
            counted(r.landmarks, "landmark"),
            r.simulated,
            r.nodes,
            r.diverged
        ),
        r.table().text().trim_end().to_owned(),
    ];
    let mm = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.2} mm"));
    lines.push(format!(
        "landmark error of these lifts {} with the best values, {} as reconstructed; the model is off by {:.1}% of a lift",
        mm(r.landmark_rmse_mm),
        mm(r.reconstructed_rmse_mm),
        100.0 * r.model_error
    ));
    lines.extend(r.notes.iter().map(|note| format!("note: {note}")));
    lines.push(format!("specimen {} in {:.1} s; report {}", r.specimen, r.seconds, r.report));
    lines.join("\n")
}
