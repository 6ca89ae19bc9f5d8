//! `trocar episode`, `trocar replay` and `trocar sweep`.

use crate::cli;
use crate::output;
use serde::Serialize;
use trocar_core::Progress;
use trocar_workflow::{EpisodeHeader, EpisodeMade, EpisodeRun, Error, Result, read_episode, replay, sweep_files};

pub fn run(arguments: &cli::Episode, json: bool, progress: &dyn Progress) -> Result<()> {
    let run = EpisodeRun {
        scene: arguments.scene.clone(),
        policy: arguments.policy.clone(),
        seed: arguments.seed,
        threads: arguments.threads,
        phantoms: arguments.phantoms.clone(),
    };
    let made = run.run(&arguments.output, progress)?;
    output::print(json, &made, text);
    Ok(())
}

/// What an episode file says of itself.
#[derive(Serialize)]
struct Told<'a> {
    steps: usize,
    #[serde(flatten)]
    header: &'a EpisodeHeader,
}

/// Does again, or tells what the file says of itself. What differs is told and then an error, so that scripts hear of it.
pub fn replay_file(arguments: &cli::Replay, json: bool, progress: &dyn Progress) -> Result<()> {
    if !arguments.verify {
        let file = read_episode(&arguments.file)?;
        output::print(json, &Told { steps: file.steps.len(), header: &file.header }, |told| {
            let h = told.header;
            format!(
                "{} steps by {} with seed {}, recorded by trocar {}; scene {}, specimen {}; --verify does them again",
                told.steps, h.policy, h.seed, h.program, h.scene_hash, h.specimen_hash
            )
        });
        return Ok(());
    }
    let specimen = arguments.specimen.as_deref();
    let verdict = replay(&arguments.file, specimen, &arguments.phantoms, arguments.threads, progress)?;
    output::print(json, &verdict, |v| if v.same { format!("the same: {}", v.said) } else { v.said.clone() });
    if verdict.same {
        return Ok(());
    }
    Err(Error::Mismatch(format!("{}: the replay differs: {}", arguments.file.display(), verdict.said)))
}

pub fn sweep(arguments: &cli::Sweep, json: bool, progress: &dyn Progress) -> Result<()> {
    let sweep = sweep_files(&arguments.channels, &arguments.gates, progress)?;
    output::print(json, &sweep, |s| {
        let mut header: Vec<&str> = s.gates.iter().map(String::as_str).collect();
        header.extend(s.stages.iter().map(|stage| stage.name()));
        let row = |r: &trocar_workflow::SweepRow| {
            let values = r.values.iter().map(|v| format!("{v:.4}"));
            values.chain(r.by_stage.iter().map(ToString::to_string)).collect::<Vec<_>>()
        };
        let rows: Vec<Vec<String>> = s.rows.iter().map(row).collect();
        format!("{} episodes; how many pass each stage:\n{}", s.episodes, output::table(&header, &rows))
    });
    Ok(())
}

fn text(made: &EpisodeMade) -> String {
    let (r, s) = (&made.result, &made.result.summary);
    let stages = s.progress.stages.iter().map(|p| match p.time_s {
        Some(time) => format!("{} at {time:.2} s", p.stage.name()),
        None => format!("{} {:.0}%", p.stage.name(), 100.0 * p.share),
    });
    let arms = s.arms.iter().map(|a| {
        format!(
            "{}: RCM deviation under load {:.3} mm median, {:.3} mm p95, {:.3} mm at most; lag {:.0} ms; peaks of {:.2} N contact, {:.2} N constraint",
            a.arm, a.rcm_median_mm, a.rcm_p95_mm, a.rcm_max_mm, a.lag_ms, a.peak_contact_n, a.peak_constraint_n
        )
    });
    let mut remarks = String::new();
    for said in [&s.why, &s.advice].into_iter().flatten() {
        remarks += &format!("\n{said}");
    }
    if let Some(said) = s.suspensions() {
        remarks += &format!("\nsuspensions of physics: {said}");
    }
    let grasp = s.grasp_at.map_or("no grasp".to_owned(), |at| format!("grasp at s = {at:.2}"));
    format!(
        "{}, {} by {} with seed {}: {} ({} of {} stages)\n{}\n{grasp}, lift {:.1} mm, slip {:.2} mm, {}; {} inverted at worst{remarks}\n{}\n{:.1} s simulated in {:.1} s ({:.2}x real time), state {}\nfolder {}",
        r.scene,
        r.task,
        r.policy,
        r.seed,
        s.end.as_ref().map_or("no end".to_owned(), ToString::to_string),
        s.stage,
        s.progress.stages.len(),
        stages.collect::<Vec<_>>().join(", "),
        s.lift_mm,
        s.slip_mm,
        if s.held_to_end { "held to the end" } else { "not held to the end" },
        s.inverted_peak,
        arms.collect::<Vec<_>>().join("\n"),
        s.duration_s,
        made.wall_s,
        made.real_time_factor,
        r.state_hash,
        made.folder
    )
}
