//! `trocar experiment settling`.

use crate::cli::SettlingExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_studies::{Result, SettlingResult};

pub fn run(arguments: &SettlingExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let named = &arguments.phantoms;
    let all = || trocar_phantom::NAMES.iter().map(|n| (*n).to_owned()).collect();
    let experiment = trocar_studies::SettlingExperiment {
        phantoms: if named.is_empty() { all() } else { named.clone() },
        record: RecordOptions { frames: arguments.frames, seed: arguments.seed, ..RecordOptions::default() },
        schedule: arguments.schedule.name(),
        threads: arguments.threads,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &SettlingResult) -> String {
    let header =
        ["phantom", "nodes", "pinned", "(paper)", "peak m/s", "after 1 s", "(paper)", "settled after", "fastest organ"];
    let rows: Vec<Vec<String>> = r
        .phantoms
        .iter()
        .map(|p| {
            let fastest = p.organs.iter().max_by(|a, b| a.speed_m_s.total_cmp(&b.speed_m_s));
            vec![
                p.phantom.clone(),
                p.nodes.to_string(),
                format!("{:.1}%", 100.0 * p.pinned),
                p.paper_pinned.map_or(String::new(), |s| format!("({:.1}%)", 100.0 * s)),
                format!("{:.3}", p.peak_speed_m_s),
                format!("{:.4}", p.speed_m_s),
                p.paper_speed_m_s.map_or(String::new(), |s| format!("({s:.3})")),
                p.settled_after_s.map_or("no".into(), |s| format!("{s:.2} s")),
                fastest.map_or(String::new(), |o| o.organ.clone()),
            ]
        })
        .collect();
    let mut out = output::table(&header, &rows);
    for p in &r.phantoms {
        if let Some(event) = &p.event {
            out += &format!("\n{}: {event}", p.phantom);
        }
    }
    out + &format!("\nschedule {}; all of it in {:.0} s; report {}", r.schedule, r.seconds, r.report)
}
