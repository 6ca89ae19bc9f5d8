//! `trocar episode`, `trocar replay` and `trocar sweep`.

use crate::cli;
use crate::commands::scene::note_reach;
use crate::output;
use serde::Serialize;
use trocar_campaign::run_episode;
use trocar_core::Progress;
use trocar_report::document::Table;
use trocar_task::ArmSummary;
use trocar_workflow::{
    EpisodeHeader, EpisodeOutput, EpisodeRun, Error, Result, counted, read_episode, replay, sweep_files,
};

pub fn run(arguments: &cli::Episode, json: bool, progress: &dyn Progress) -> Result<()> {
    let run = EpisodeRun {
        scene: arguments.scene.clone(),
        policy: arguments.policy.clone(),
        seed: arguments.seed,
        variation: arguments.variation,
        surfaces: arguments.surfaces,
        threads: arguments.threads,
        phantoms: arguments.phantoms.clone(),
    };
    note_reach(&arguments.scene);
    let made = run_episode(&run, &arguments.output, progress)?;
    output::print(json, &made, text);
    Ok(())
}

/// The header of an episode file.
#[derive(Serialize)]
struct EpisodeSummary<'a> {
    steps: usize,
    #[serde(flatten)]
    header: &'a EpisodeHeader,
}

/// Verifies an episode by a replay, or prints its header. A difference is an error, so that scripts
/// notice it.
pub fn replay_file(arguments: &cli::Replay, json: bool, progress: &dyn Progress) -> Result<()> {
    if !arguments.verify {
        let file = read_episode(&arguments.file)?;
        output::print(json, &EpisodeSummary { steps: file.steps.len(), header: &file.header }, |summary| {
            let h = summary.header;
            format!(
                "{} by {} with seed {}, recorded by trocar {}; scene {}, specimen {}; --verify replays and compares every step",
                counted(summary.steps, "step"),
                h.policy,
                h.seed,
                h.program,
                h.scene_hash,
                h.specimen_hash
            )
        });
        return Ok(());
    }
    let specimen = arguments.specimen.as_deref();
    let verdict = replay(&arguments.file, specimen, &arguments.phantoms, arguments.threads, progress)?;
    if json || verdict.same {
        output::print(json, &verdict, |v| format!("the same: {}", v.said));
    }
    if verdict.same {
        return Ok(());
    }
    Err(Error::Mismatch(format!("{}: the replay differs: {}", arguments.file.display(), verdict.said)))
}

pub fn sweep(arguments: &cli::Sweep, json: bool, progress: &dyn Progress) -> Result<()> {
    let sweep = sweep_files(&arguments.channels, &arguments.gates, progress)?;
    output::print(json, &sweep, |s| {
        let row = |r: &trocar_workflow::SweepRow| {
            let values = r.values.iter().map(|v| format!("{v:.4}"));
            values.chain(r.by_stage.iter().map(ToString::to_string)).collect::<Vec<_>>()
        };
        let table = Table::new(s.gates.iter().chain(&s.stages).cloned(), s.rows.iter().map(row).collect());
        let episodes = counted(s.episodes, "episode");
        format!("{episodes}; passed stages:\n{}", table.text().trim_end())
    });
    Ok(())
}

fn text(made: &EpisodeOutput) -> String {
    let (r, s) = (&made.result, &made.result.summary);
    let stages = s.progress.stages.iter().map(|p| match p.time_s {
        Some(time) => format!("{} at {time:.2} s", p.stage),
        None => format!("{} {:.0}%", p.stage, 100.0 * p.share),
    });
    let mut remarks = String::new();
    let end = s.end.as_ref().map_or("no end".to_owned(), ToString::to_string);
    // The reason of some ends is the end itself.
    let why = s.why.as_ref().filter(|why| **why != end);
    for said in why.into_iter().chain(&s.advice) {
        remarks += &format!("\n{said}");
    }
    if let Some(said) = s.warnings.described() {
        remarks += &format!("\nbeyond what tissue withstands: {said}");
    }
    let grasp = match (s.grasp_at, s.lift_mm, s.slip_mm) {
        (Some(at), Some(lift), Some(slip)) => {
            let held = if s.held_to_end { "held to the end" } else { "not held to the end" };
            format!("grasp at s = {at:.2}, lift {lift:.1} mm, slip {slip:.2} mm, {held}")
        }
        _ if r.task == "port-reach" => "no grasp in this task".to_owned(),
        _ => "no grasp".to_owned(),
    };
    format!(
        "{}, {} by {} with seed {}: {} ({} of {} stages)\n{}\n{grasp}; at most {} inverted{remarks}\n{}\n{:.1} s simulated in {:.1} s ({:.2}x real time), state {}\nfolder {}; report {}",
        r.scene,
        r.task,
        r.policy,
        r.seed,
        end,
        s.stage,
        s.progress.stages.len(),
        stages.collect::<Vec<_>>().join(", "),
        s.inverted_peak,
        s.arms.iter().map(|a| arm(a, s.duration_s > 0.0)).collect::<Vec<_>>().join("\n"),
        s.duration_s,
        made.wall_s,
        made.real_time_factor,
        r.state_hash,
        made.folder,
        made.report
    )
}

/// A line for an arm; `moved` says whether any time was simulated.
fn arm(a: &ArmSummary, moved: bool) -> String {
    if !moved {
        return format!("{}: nothing was measured", a.arm);
    }
    let lag = a.lag_ms.map_or("lag not measured".to_owned(), |lag| format!("lag {lag:.0} ms"));
    format!(
        "{}: {}; {lag}; peak contact {:.2} N, peak constraint {:.2} N",
        a.arm,
        rcm(a),
        a.peak_contact_n,
        a.peak_constraint_n
    )
}

/// The RCM deviation of an arm, or why it was not measured.
pub fn rcm(a: &ArmSummary) -> String {
    match (a.rcm_median_mm, a.rcm_p95_mm, a.rcm_max_mm) {
        (Some(median), Some(p95), Some(max)) => {
            format!("RCM deviation under load {median:.3} mm median, {p95:.3} mm p95, {max:.3} mm at most")
        }
        _ if a.rcm_peak_mm == 0.0 => "RCM deviation not measured".to_owned(),
        _ => format!("never under load; RCM deviation {:.3} mm at most", a.rcm_peak_mm),
    }
}
