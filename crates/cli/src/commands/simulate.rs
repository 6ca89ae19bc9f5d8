//! `trocar simulate`.

use crate::cli::{Simulate, Task};
use crate::commands::episode::rcm;
use crate::output;
use trocar_core::Progress;
use trocar_scene::Builtin;
use trocar_task::Severed;
use trocar_task::policy::{AfterHold, CutAt, Script};
use trocar_workflow::{Lift, LiftResult, Result, counted};

/// Default organ coordinate of the grasp.
const AT: f64 = 0.5;
/// Default with a cut, which needs space towards the base.
const AT_WITH_CUT: f64 = 0.7;

pub fn run(arguments: &Simulate, json: bool, progress: &dyn Progress) -> Result<()> {
    let Task::GraspLift = arguments.task;
    // Specimens are folders; anything else is a scene.
    let name = arguments.specimen.to_string_lossy();
    let is_file = arguments.specimen.is_file() || arguments.specimen.extension().is_some_and(|e| e == "toml");
    let scene = !arguments.specimen.is_dir() && (is_file || Builtin::named(&name).is_some());
    let after = match arguments.sever {
        Some(at) => AfterHold::Cut(at.map_or(CutAt::Between, CutAt::S)),
        None if scene => AfterHold::Finish,
        None => AfterHold::Lower,
    };
    let lift = Lift {
        script: Script {
            at: arguments.at.unwrap_or(if arguments.sever.is_some() { AT_WITH_CUT } else { AT }),
            approach_offset: arguments.approach_offset * 1e-3,
            lift: arguments.lift * 1e-3,
            regrasp: arguments.regrasp.map(|drag| drag * 1e-3),
            retries: 0,
            after,
        },
        organ: arguments.organ.clone(),
        design: arguments.design.map(Into::into),
        jaw_force: arguments.jaw_force,
        schedule: arguments.schedule.map(Into::into),
        threads: arguments.threads,
    };
    let result = match scene {
        true => lift.run_scene(&name, &arguments.phantoms, &arguments.output, progress)?,
        false => lift.run_specimen(&arguments.specimen, &arguments.output, progress)?,
    };
    output::print(json, &result, |r: &LiftResult| format!("{}\nreport {}", text(r), r.report));
    Ok(())
}

pub fn text(r: &LiftResult) -> String {
    let s = &r.episode.summary;
    let d = &s.details;
    let peak = |of: fn(&trocar_task::ArmSummary) -> f64| s.arms.iter().map(of).fold(0.0, f64::max);
    let measured = |v: Option<f64>, decimals: usize| v.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    let grasp = match (s.follow_ratio, s.slip_mm) {
        (Some(follow), Some(slip)) => format!(
            "{} grasp, {} held, jaws closed on {} mm with {} N: lift {} mm (follows {:.0}%), slip {slip:.3} mm, snap {} mm, activation step {} mm: {}",
            d.design,
            counted(d.held_nodes.unwrap_or(0), "node"),
            measured(d.gap_mm, 1),
            measured(d.closing_force_n, 2),
            measured(s.lift_mm, 2),
            100.0 * follow,
            measured(d.snap_mm, 3),
            measured(d.activation_step_mm, 3),
            if s.held { "held" } else { "NOT held" },
        ),
        _ => "no grasp: NOT held".to_owned(),
    };
    let mut text = format!(
        "{}: {} at s = {:.2}, {grasp}\n\
         peak contact {:.2} N, peak constraint {:.2} N; {:.4} m/s after settling, {:.2} s of kinetic damping to {:.4} m/s; {} inverted at rest, at most {} in any frame, smallest volume {:.0}% of rest; pins drift {:.6} mm; {}",
        r.episode.scene,
        d.organ,
        r.at,
        peak(|a| a.peak_contact_n),
        peak(|a| a.peak_constraint_n),
        d.settling.settled_speed_m_s,
        d.settling.damped_s,
        d.settling.resting_speed_m_s,
        d.inverted_rest,
        s.inverted_peak,
        100.0 * s.min_volume_ratio,
        d.pin_drift_mm,
        if s.diverged {
            format!("DIVERGED: {}", s.end.as_ref().map_or(String::new(), ToString::to_string))
        } else {
            "no divergence".to_owned()
        },
    );
    for arm in s.arms.iter().filter(|a| a.rcm_peak_mm > 0.0) {
        text += &format!("\n{}: {}", arm.arm, rcm(arm));
    }
    if let Some(said) = s.warnings.described() {
        text += &format!("\nbeyond what tissue withstands: {said}");
    }
    for said in [&s.why, &s.advice].into_iter().flatten() {
        text += &format!("\n{said}");
    }
    if let Some(sever) = &d.sever {
        text += &format!("\n{}", cut(sever));
    }
    text + &format!(
        "\n{:.1} s simulated in {:.1} s ({:.2}x real time), state {}",
        r.simulated_s, r.wall_s, r.real_time_factor, r.episode.state_hash
    )
}

fn cut(s: &Severed) -> String {
    let c = &s.cut;
    if c.pieces.is_empty() {
        return c.said.clone();
    }
    let pieces: Vec<String> = c
        .pieces
        .iter()
        .map(|p| {
            format!(
                "  {}: s {:.2} to {:.2}, {} nodes ({} pinned, {} in the jaws), {} elements, {:.1} mm3, moved up {:+.1} mm",
                p.name, p.s_from, p.s_to, p.nodes, p.pinned, p.held, p.elements, p.volume_after_mm3, p.rise_mm
            )
        })
        .collect();
    format!(
        "{}: s = {:.2} to {:.2}, {:.2} s into the episode, {:.2} to {:.2} rad; volume {:.1} mm3 before, {:.1} after (difference {:.0e}); {} inverted; jaws went up {:.1} mm, tissue in them {:.1} mm: {}\n{}",
        c.said,
        c.at_least,
        c.at_most,
        s.time_s,
        c.opened_rad,
        c.closed_rad,
        c.volume_before_mm3,
        c.volume_after_mm3,
        c.volume_error,
        c.inverted_after.max(s.inverted_peak),
        s.jaw_rise_mm,
        s.held_rise_mm,
        if s.held { "held" } else { "NOT held" },
        pieces.join("\n")
    )
}
