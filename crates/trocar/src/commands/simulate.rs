//! `trocar simulate`.

use crate::cli::{Simulate, Task};
use crate::output;
use trocar_cell::{GraspLift, Summary};
use trocar_evaluate::scenes::solver_named;
use trocar_evaluate::{Result, SimulatedRun, simulate};
use trocar_progress::Progress;

pub fn run(arguments: &Simulate, json: bool, progress: &dyn Progress) -> Result<()> {
    let Task::GraspLift = arguments.task;
    let task = GraspLift {
        organ: arguments.organ.clone(),
        at: arguments.at,
        lift: arguments.lift * 1e-3,
        design: arguments.design.into(),
        jaw_force: arguments.jaw_force,
        approach_offset: arguments.approach_offset * 1e-3,
        regrasp: arguments.regrasp.map(|drag| drag * 1e-3),
        schedule: solver_named(&arguments.schedule.name())?,
        threads: arguments.threads,
        ..GraspLift::default()
    };
    let run = simulate(&arguments.specimen, &task, &arguments.output, progress)?;
    output::print(json, &run, |r: &SimulatedRun| format!("{}\nreport {}", text(&r.summary), r.report));
    Ok(())
}

/// A run in a few lines for people.
pub fn text(s: &Summary) -> String {
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
