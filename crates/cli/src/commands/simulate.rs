//! `trocar simulate`.

use crate::cli::{Simulate, Task};
use crate::output;
use trocar_cell::{CellLift, GraspDesign, GraspLift, JAW_FORCE, SeverAt, Severance, Summary};
use trocar_core::Progress;
use trocar_scene::Builtin;
use trocar_workflow::solver_named;
use trocar_workflow::{CellRun, CellSimulation, Error, Result, SimulatedRun, simulate};

/// Organ coordinate of the grasp unless the user says otherwise, and where a cut needs room on the base's side.
const AT: f64 = 0.5;
const AT_WITH_CUT: f64 = 0.7;

pub fn run(arguments: &Simulate, json: bool, progress: &dyn Progress) -> Result<()> {
    let Task::GraspLift = arguments.task;
    // A specimen is a folder; what is none is a scene.
    let name = arguments.specimen.to_string_lossy();
    if !arguments.specimen.is_dir() && (arguments.specimen.is_file() || Builtin::named(&name).is_some()) {
        return in_cell(arguments, &name, json, progress);
    }
    let schedule = arguments.schedule.unwrap_or(crate::cli::SolverName::Fast);
    let task = GraspLift {
        organ: arguments.organ.clone(),
        at: arguments.at.unwrap_or(if arguments.sever.is_some() { AT_WITH_CUT } else { AT }),
        lift: arguments.lift * 1e-3,
        design: arguments.design.map_or_else(GraspDesign::default, Into::into),
        jaw_force: arguments.jaw_force.unwrap_or(JAW_FORCE),
        approach_offset: arguments.approach_offset * 1e-3,
        regrasp: arguments.regrasp.map(|drag| drag * 1e-3),
        sever: arguments.sever.map(|at| at.map_or(SeverAt::Between, SeverAt::S)),
        schedule: solver_named(schedule.name())?,
        threads: arguments.threads,
        ..GraspLift::default()
    };
    let run = simulate(&arguments.specimen, &task, &arguments.output, progress)?;
    output::print(json, &run, |r: &SimulatedRun| format!("{}\nreport {}", text(&r.summary), r.report));
    Ok(())
}

/// The same task in the two-arm cell of a scene.
fn in_cell(arguments: &Simulate, scene: &str, json: bool, progress: &dyn Progress) -> Result<()> {
    let refused = |option: &str, instead: &str| Err(Error::Mismatch(format!("{option} is for specimens; {instead}")));
    if arguments.schedule.is_some() {
        return refused("--schedule", "a scene says it in tissue.schedule");
    }
    if arguments.sever.is_some() || arguments.approach_offset != 0.0 {
        return refused("--sever or --approach-offset", "the cell's script grasps and lifts only");
    }
    let simulation = CellSimulation {
        scene: scene.to_owned(),
        task: CellLift {
            organ: arguments.organ.clone(),
            at: arguments.at.unwrap_or(AT),
            lift: arguments.lift * 1e-3,
            design: arguments.design.map(Into::into),
            regrasp: arguments.regrasp.map(|drag| drag * 1e-3),
            ..CellLift::default()
        },
        jaw_force: arguments.jaw_force,
        threads: arguments.threads,
        phantoms: arguments.phantoms.clone(),
    };
    let run = simulation.run(&arguments.output, progress)?;
    output::print(json, &run, |r: &CellRun| format!("{}\nreport {}", cell_text(r), r.report));
    Ok(())
}

/// A run in the cell in a few lines for people.
fn cell_text(run: &CellRun) -> String {
    let s = &run.summary;
    format!(
        "{}: {} arm, {} at s = {:.2}, {} grasp, {} nodes held: lift {:.2} mm (follows {:.0}%), slip {:.3} mm, snap {:.3} mm: {}\n\
         RCM deviation under load {:.3} mm median, {:.3} mm at most, {:.3} mm in the whole run; {:.3} mm before the grasp, {:.3} mm after; peaks of {:.2} N contact, {:.2} N constraint\n\
         {} inverted at worst, smallest volume {:.0}% of rest; yields in {} substeps; {}\n\
         {:.1} s simulated in {:.1} s ({:.2}x real time), state {}",
        run.scene,
        s.arm,
        s.organ,
        s.at,
        s.design,
        s.held_nodes,
        s.lift_mm,
        100.0 * s.follow_ratio,
        s.slip_mm,
        s.snap_mm,
        if s.held { "held" } else { "NOT held" },
        s.rcm_median_mm,
        s.rcm_max_mm,
        s.rcm_run_max_mm,
        s.rcm_before_grasp_mm,
        s.rcm_after_grasp_mm,
        s.peak_contact_n,
        s.peak_constraint_n,
        s.inverted_peak,
        100.0 * s.min_volume_ratio,
        s.yielded_substeps,
        s.divergence.as_deref().map_or("no divergence".to_owned(), |why| format!("DIVERGED: {why}")),
        s.simulated_s,
        s.wall_s,
        s.real_time_factor,
        s.state_hash
    )
}

/// A run in a few lines for people.
pub fn text(s: &Summary) -> String {
    let mut text = figures(s);
    if let Some(advice) = s.force_advice() {
        text += &format!("\n{advice}");
    }
    if let Some(sever) = &s.sever {
        text += &format!("\n{}", cut(sever));
    }
    text
}

/// A cut in a few lines for people.
fn cut(s: &Severance) -> String {
    if s.pieces.is_empty() {
        return s.said.clone();
    }
    let pieces: Vec<String> = s
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
        "{}: s = {:.2} to {:.2}, {:.2} s into the run, {:.2} to {:.2} rad; volume {:.1} mm3 before, {:.1} after (off by {:.0e} of it); {} inverted; jaws went up {:.1} mm, tissue in them {:.1} mm: {}\n{}",
        s.said,
        s.at_least,
        s.at_most,
        s.time_s,
        s.opened_rad,
        s.closed_rad,
        s.volume_before_mm3,
        s.volume_after_mm3,
        s.volume_error,
        s.inverted_after.max(s.inverted_peak),
        s.jaw_rise_mm,
        s.held_rise_mm,
        if s.held { "held" } else { "NOT held" },
        pieces.join("\n")
    )
}

/// The lift in figures.
fn figures(s: &Summary) -> String {
    format!(
        "{} at s = {:.2}, {} grasp, {} nodes held, jaws closed on {:.1} mm with {:.2} N{}: lift {:.2} mm (follows {:.0}%), slip {:.3} mm, snap {:.3} mm: {}\n\
         {:.4} m/s after 1 s, calmed for {:.2} s to {:.4} m/s, peak {:.3} m/s; {} inverted at rest, {} at worst, smallest volume {:.0}% of rest; pins drift {} mm; {}\n\
         {:.1} s simulated in {:.1} s ({:.2}x real time), state {}",
        s.organ,
        s.at,
        s.design,
        s.held_nodes,
        s.gap_mm,
        s.closing_force_n,
        if s.attached { "" } else { " (nothing between them)" },
        s.lift_mm,
        100.0 * s.follow_ratio,
        s.slip_mm,
        s.snap_mm,
        if s.held { "held" } else { "NOT held" },
        s.settled_speed_m_s,
        s.calmed_s,
        s.resting_speed_m_s,
        s.peak_speed_m_s,
        s.inverted_rest,
        s.inverted_peak,
        100.0 * s.min_volume_ratio,
        s.pin_drift_mm,
        s.divergence.as_deref().map_or("no divergence".to_owned(), |why| format!("DIVERGED: {why}")),
        s.simulated_s,
        s.wall_s,
        s.real_time_factor,
        s.state_hash
    )
}
