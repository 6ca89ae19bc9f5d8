//! `trocar bench scaling`.

use crate::cli::ScalingBench;
use crate::output;
use trocar_core::Progress;
use trocar_studies::{Result, ScalingResult};

pub fn run(arguments: &ScalingBench, json: bool, progress: &dyn Progress) -> Result<()> {
    let bench = trocar_studies::ScalingBench {
        sizes: arguments.sizes.clone(),
        threads: arguments.threads.clone(),
        budget: arguments.budget,
        many: arguments.many,
        small: arguments.small,
    };
    output::print(json, &bench.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &ScalingResult) -> String {
    let mut rows = Vec::new();
    let mut skipped = String::new();
    for row in &r.rows {
        if let Some(t) = &row.timing {
            rows.push(vec![
                row.schedule.clone(),
                row.threads.to_string(),
                row.tets.to_string(),
                row.nodes.to_string(),
                format!("{:.2}", t.frame_ms_median),
                format!("{:.2}x", t.real_time_factor),
                t.inverted.to_string(),
            ]);
        }
        if let Some(why) = &row.skipped {
            skipped += &format!("\n{}, {} threads, {} tets left out: {why}", row.schedule, row.threads, row.tets);
        }
    }
    let sizes = output::table(&["schedule", "threads", "tets", "nodes", "median ms", "real time", "inverted"], &rows);
    let many = r.many.iter().map(|m| {
        format!(
            "\n{} models at once, {}, {} threads, {} tets: {:.2} ms, in one model {:.2} ms: {:+.1}%; six organs of {} tets {:.2} ms: {:+.1}% an element",
            m.models,
            m.schedule,
            m.threads,
            m.tets,
            m.many_ms,
            m.one_model_ms,
            100.0 * m.loss,
            m.organs_tets,
            m.organs_ms,
            100.0 * m.loss_against_organs
        )
    });
    format!("{sizes}{skipped}{}\nreport {}", many.collect::<String>(), r.report)
}
