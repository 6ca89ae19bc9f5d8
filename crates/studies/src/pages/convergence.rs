//! The page of the convergence experiment: errors over iterations and over time, scene by scene.

use crate::Result;
use crate::experiment::{ConvergenceCase, ConvergenceResult, StepRow};
use trocar_report::colors;
use trocar_report::page::{self, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed};
use trocar_testing::scenes::SCENES;

/// The material drawn in full colour: Young's modulus [kPa] and Poisson's ratio.
const BASE: (f64, f64) = (12.0, 0.45);

/// What a scene is.
fn described(scene: &str) -> &'static str {
    match scene {
        "sag" => "At rest under gravity, the lowest 42% of the nodes pinned: the exact step moves nothing.",
        "drag" => "A patch is pulled up at 10 mm/s, 0.2 s after it began.",
        "shake" => "A patch is shaken by 1 mm at 7.3 Hz, 0.17 s after it began.",
        "tube" => {
            "Pinned within 10 mm of one end, the middle lifted at 30 mm/s, 0.25 s after it began: large, slow, global motion."
        }
        _ => {
            "Nothing holds it; it falls since 0.1 s. The predictor of implicit Euler is its exact step, so there is no excess energy to compare with."
        }
    }
}

pub(super) fn body(result: &ConvergenceResult) -> Result<String> {
    let lead = format!(
        "One substep of {} ({} elements, {} nodes) from one state, with 1, 2, 4, \u{2026} iterations, against the minimum that Newton's method finds in double \
         precision for the same substep. Time is that of the substep on one thread, the least of five.",
        page::escape(&result.mesh),
        count(result.tets),
        count(result.nodes)
    );
    let mut body = page::section("What was done", &lead, "");
    for scene in SCENES {
        let cases: Vec<&ConvergenceCase> = result.cases.iter().filter(|c| c.scene == scene).collect();
        if !cases.is_empty() {
            body += &page::section(scene, described(scene), &(plots(result, &cases)? + &failures(&cases)));
        }
    }
    Ok(body + &own(result))
}

fn plots(result: &ConvergenceResult, cases: &[&ConvergenceCase]) -> Result<String> {
    type Value = fn(&StepRow) -> f64;
    let over: [(&'static str, Value); 2] = [("iterations", |r| r.iterations as f64), ("wall time [ms]", |r| r.wall_ms)];
    let errors: [(&'static str, &'static str, Value); 2] = [
        ("Position error", "RMS [\u{b5}m]", |r| r.position_error_um),
        ("Energy error", "over the predictor's", |r| r.energy_error.unwrap_or(f64::NAN)),
    ];
    let mut figures = Vec::new();
    for (title, y, error) in errors {
        for (x, along) in over {
            let lines = lines(result, cases, along, error);
            if lines.iter().all(|l| l.points.iter().all(|p| !p.1.is_finite())) {
                continue;
            }
            let plot =
                Plot { title, x, y, lines, bands: vec![], show: vec![], limits: vec![], log_x: true, log_y: true };
            let legend = result.schedules.iter().enumerate().map(|(k, name)| (name.as_str(), colors::organ(k)));
            figures.push(page::figure(&plot.svg()?, &format!("<b>{title}</b> over {x}.{}", page::legend(legend))));
        }
    }
    Ok(page::grid(Columns::Two, &figures))
}

/// A line a schedule and material, the base material last and in full colour.
fn lines(
    result: &ConvergenceResult,
    cases: &[&ConvergenceCase],
    along: fn(&StepRow) -> f64,
    error: fn(&StepRow) -> f64,
) -> Vec<Line> {
    let base = cases.iter().find(|c| (c.young_kpa, c.poisson) == BASE).or(cases.first());
    let is_base = |c: &ConvergenceCase| base.is_some_and(|b| (b.young_kpa, b.poisson) == (c.young_kpa, c.poisson));
    let mut lines = Vec::new();
    for full in [false, true] {
        for (k, name) in result.schedules.iter().enumerate() {
            let color = if full { colors::organ(k) } else { colors::mix(colors::organ(k), [150, 156, 162], 0.72) };
            for case in cases.iter().filter(|c| is_base(c) == full) {
                let rows = case.rows.iter().filter(|r| r.schedule == *name);
                lines.push(Line { points: rows.map(|r| (along(r), error(r))).collect(), color, filled: false });
            }
        }
    }
    lines
}

fn failures(cases: &[&ConvergenceCase]) -> String {
    let failed = cases.iter().filter_map(|c| c.failure.as_ref().map(|why| (c, why)));
    page::list(&failed.map(|(c, why)| format!("{} kPa, nu {}: {why}", c.young_kpa, c.poisson)).collect::<Vec<_>>())
}

/// Every case with the schedules' own iterations.
fn own(result: &ConvergenceResult) -> String {
    let head = [
        "Scene",
        "E [kPa]",
        "nu",
        "Schedule",
        "Iterations",
        "ms",
        "RMS error [\u{b5}m]",
        "over displacement",
        "Energy",
        "Inverted",
    ];
    let scientific = |v: Option<f64>| v.map_or("\u{2013}".to_owned(), |v| format!("{v:.1e}"));
    let mut rows = Vec::new();
    for case in &result.cases {
        for r in case.rows.iter().filter(|r| r.own) {
            rows.push(vec![
                case.scene.clone(),
                case.young_kpa.to_string(),
                case.poisson.to_string(),
                r.schedule.clone(),
                r.iterations.to_string(),
                fixed(r.wall_ms, 3),
                format!("{:.2e}", r.position_error_um),
                scientific(Some(r.position_error)),
                scientific(r.energy_error),
                r.inverted.to_string(),
            ]);
        }
    }
    page::section(
        "With each schedule's own iterations",
        "One substep. <i>Over displacement</i>: over the RMS distance from the rest shape. <i>Energy</i>: the incremental potential above the minimum, over that of the \
         inertial predictor; what single precision leaves of it is about 1e-10. In the plots full colour is 12 kPa and nu 0.45, pale the \
         other materials.",
        &table::plain(&head, &rows),
    )
}
