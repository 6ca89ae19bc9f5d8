//! `trocar experiment grasp-designs`.

use crate::cli::GraspDesignsExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{GraspDesignRow, GraspDesignsResult, Result};

pub fn run(arguments: &GraspDesignsExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let experiment = trocar_studies::GraspDesignsExperiment {
        appendix: (&arguments.appendix).into(),
        conditions: arguments.condition.conditions(),
        lift: 1e-3 * arguments.lift,
        jaw_force: arguments.jaw_force,
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &GraspDesignsResult) -> String {
    let header = [
        "condition",
        "design",
        "held",
        "diverged",
        "lift mm",
        "slip mm",
        "snap mm",
        "step mm",
        "inverted",
        "least volume",
        "suspensions",
    ];
    let range = |ends: Option<(f64, f64)>| match ends {
        None => "-".to_owned(),
        Some((least, most)) if most - least < 0.05 => format!("{most:.2}"),
        Some((least, most)) => format!("{least:.1}-{most:.1}"),
    };
    let ours = |row: &GraspDesignRow| {
        let [contacts, blades, relaxed] = row.suspensions;
        vec![
            row.condition.name().to_owned(),
            row.design.clone(),
            format!("{}/{}", row.held, row.trials),
            row.diverged.to_string(),
            format!("{:.2}", row.lift_median_mm),
            format!("{:.3}", row.slip_median_mm),
            range(row.snap_least_mm.zip(row.snap_mm)),
            format!("{:.3}", row.activation_step_median_mm),
            row.inverted_peak.to_string(),
            format!("{:.2}", row.min_volume_ratio),
            format!("{contacts}/{blades}/{relaxed}"),
        ]
    };
    let paper = |row: &GraspDesignRow| {
        row.paper.map(|p| {
            let mut cells = vec![
                String::new(),
                "  (paper)".to_owned(),
                format!("{}/{}", p.held, p.trials),
                p.diverged.to_string(),
                format!("{:.1}", p.lift_mm),
                format!("{:.2}", p.slip_mm),
                range(p.snap_mm),
            ];
            cells.resize(header.len(), String::new());
            cells
        })
    };
    let rows: Vec<Vec<String>> = r.rows.iter().flat_map(|row| std::iter::once(ours(row)).chain(paper(row))).collect();
    format!(
        "{}\nMedians, as the paper's. Snap: what the grasp prescribes, zero by construction for live-pose and compliant. Step: what moves in the grasp's first frame. \
         Suspensions: contacts disabled / contacts of blades disabled / organs relaxed.\n\
         the appendix: {} nodes, {} tets, {} kPa, {} kg/m3; {} mm lift, jaws of {} N; {:.0} s{}; report {}",
        output::table(&header, &rows),
        r.nodes,
        r.tets,
        r.modulus_kpa,
        r.density_kg_m3,
        r.lift_mm,
        r.jaw_force_n,
        r.seconds,
        super::resumed(&r.resumed, "trials"),
        r.report
    )
}
