//! Convergence of solvers: one substep of each scene from the same state with more and more
//! iterations, compared with the minimum found by the oracle.

mod step_ladder;

use crate::names::kilopascals;
use crate::scenes::{BenchScene, Organs, SCENES, material};
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use step_ladder::StepRow;
use trocar_core::Progress;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page;
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed};
use trocar_workflow::SOLVERS;

/// Error of each iteration against the exact step: scenes, moduli and Poisson's ratios, over
/// iterations and over time.
#[derive(Clone, Debug, Args)]
pub struct ConvergenceExperiment {
    /// Gmsh file (.msh, in metres, z up) with an appendix; our own appendix by default.
    #[arg(long, value_name = "FILE", conflicts_with = "tets")]
    pub mesh: Option<PathBuf>,
    /// Approximate number of elements of our own appendix.
    #[arg(long, default_value_t = 2_500)]
    pub tets: usize,
    /// Scenes (sag, drag, shake, tube, fall); all by default.
    #[arg(long = "scene")]
    pub scenes: Vec<String>,
    /// Young's moduli (kPa).
    #[arg(long = "young", value_delimiter = ',', value_parser = kilopascals, default_value = "3,12,48")]
    pub young_moduli: Vec<f64>,
    /// Poisson's ratios.
    #[arg(long = "poisson", value_delimiter = ',', default_values_t = [0.3, 0.45, 0.49])]
    pub poisson_ratios: Vec<f64>,
    /// Maximum number of iterations; they double from 1.
    #[arg(long = "iterations", default_value_t = 512)]
    pub max_iterations: usize,
}

/// A scene with a material: the unit of resume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConvergenceCase {
    /// The scene.
    pub scene: String,
    /// Young's modulus (kPa).
    pub young_kpa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Why there are no rows, if there are none.
    pub failure: Option<String>,
    /// All schedules with all numbers of iterations.
    pub rows: Vec<StepRow>,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceResult {
    /// All scenes with all materials.
    pub cases: Vec<ConvergenceCase>,
    /// Names of the schedules.
    pub schedules: Vec<String>,
    /// Source of the appendix.
    pub mesh: String,
    /// Elements of the appendix.
    pub tets: usize,
    /// Nodes of the appendix.
    pub nodes: usize,
    /// Cases of an earlier run that were used again.
    pub reused: usize,
}

impl Study for ConvergenceExperiment {
    const NAME: &'static str = "convergence";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some("Output folder of the report. Finished cases in it are used again.");
    type Figures = ConvergenceResult;

    fn run(&self, job: &Job<'_>) -> Result<(ConvergenceResult, Document)> {
        if let Some(name) = self.scenes.iter().find(|s| !SCENES.contains(&s.as_str())) {
            return Err(Error::Mismatch(format!("there is no scene '{name}'; there are {}", SCENES.join(", "))));
        }
        let all = || SCENES.map(str::to_owned).to_vec();
        let scenes = if self.scenes.is_empty() { all() } else { self.scenes.clone() };
        let organs = match &self.mesh {
            Some(path) => Organs::read(path)?.only_appendix(),
            None => Organs::analytic_appendix(self.tets)?,
        };
        job.claim()?;
        let mut materials = Vec::new();
        for scene in &scenes {
            for young in &self.young_moduli {
                materials.extend(self.poisson_ratios.iter().map(|poisson| (scene.as_str(), *young, *poisson)));
            }
        }
        let key = |(scene, young, poisson): &(&str, f64, f64)| format!("{scene}, {} kPa, {poisson}", young / 1e3);
        // On one thread, because times are measured.
        let one = |case: &(&str, f64, f64), progress: &dyn Progress| self.case(&organs, *case, progress);
        let Outcomes { rows: cases, resumed } =
            job.trials("cases", &self.settings(&organs)?, &materials, key, 1, one)?;
        let result = ConvergenceResult {
            cases,
            schedules: SOLVERS.map(str::to_owned).into(),
            mesh: organs.source.clone(),
            tets: organs.tets(),
            nodes: organs.nodes(),
            reused: resumed.trials,
        };
        let document = document(&result)?;
        Ok((result, document))
    }
}

impl ConvergenceExperiment {
    fn case(
        &self,
        organs: &Organs,
        (scene, young, poisson): (&str, f64, f64),
        progress: &dyn Progress,
    ) -> Result<ConvergenceCase> {
        let made = BenchScene::named(scene, organs, material(young, poisson))
            .and_then(|scene| step_ladder::measure(&scene, &SOLVERS, self.max_iterations, progress));
        let (rows, failure) = match made {
            Ok(rows) => (rows, None),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => (Vec::new(), Some(why.to_string())),
        };
        Ok(ConvergenceCase { scene: scene.to_owned(), young_kpa: young / 1e3, poisson, failure, rows })
    }

    /// Everything that rows depend on besides scene and material.
    fn settings(&self, organs: &Organs) -> Result<String> {
        let schedules =
            SOLVERS.iter().map(|s| trocar_workflow::solver_named(s)).collect::<std::result::Result<Vec<_>, _>>()?;
        Ok(format!(
            "{} with {} nodes and {} tets, to {} iterations, {schedules:?}",
            organs.source,
            organs.nodes(),
            organs.tets(),
            self.max_iterations
        ))
    }
}

/// The material drawn in full colour: Young's modulus (kPa), Poisson's ratio.
const BASE: (f64, f64) = (12.0, 0.45);

fn described(scene: &str) -> &'static str {
    match scene {
        "sag" => "At rest under gravity, the lowest 42% of the nodes pinned: the exact step moves no node.",
        "drag" => "A patch is pulled up at 10 mm/s, after 0.2 s.",
        "shake" => "A patch is shaken by 1 mm at 7.3 Hz, after 0.17 s.",
        "tube" => {
            "Pinned within 10 mm of one end, the middle lifted at 30 mm/s, after 0.25 s: large, slow, global motion."
        }
        _ => {
            "Free fall for 0.1 s. The predictor of implicit Euler is the exact step, so no excess energy can be \
             compared."
        }
    }
}

fn document(result: &ConvergenceResult) -> Result<Document> {
    let lead = format!(
        "One substep of {} ({} elements, {} nodes) from one state, with 1, 2, 4, \u{2026} iterations, \
         compared with the minimum that Newton's method finds in double \
         precision for the same substep. The time is that of the substep on one thread, the least of five.",
        page::escape(&result.mesh),
        count(result.tets),
        count(result.nodes)
    );
    let subtitle = "Position and energy error of one substep, over iterations and over time";
    let mut document = Document::new("Convergence", subtitle).with(Section::new("Method", lead));
    for scene in SCENES {
        let cases: Vec<&ConvergenceCase> = result.cases.iter().filter(|c| c.scene == scene).collect();
        if !cases.is_empty() {
            document =
                document.with(plots(result, &cases, Section::new(scene, described(scene)))?.lines(failures(&cases)));
        }
    }
    Ok(document.with(default_iterations(result)))
}

fn plots(result: &ConvergenceResult, cases: &[&ConvergenceCase], mut section: Section) -> Result<Section> {
    type Value = fn(&StepRow) -> f64;
    let over: [(&'static str, Value); 2] = [("iterations", |r| r.iterations as f64), ("wall time (ms)", |r| r.wall_ms)];
    let errors: [(&'static str, &'static str, Value); 2] = [
        ("Position error", "RMS (\u{b5}m)", |r| r.position_error_um),
        ("Energy error", "over the predictor's", |r| r.energy_error.unwrap_or(f64::NAN)),
    ];
    for (title, y, error) in errors {
        for (x, along) in over {
            let lines = lines(result, cases, along, error);
            if lines.iter().all(|l| l.points.iter().all(|p| !p.1.is_finite())) {
                continue;
            }
            let plot = Plot { title, x, y, lines, log_x: true, log_y: true, ..Plot::default() };
            let legend = result.schedules.iter().enumerate().map(|(k, name)| (name.as_str(), colors::organ(k)));
            section = section.plot(&plot, &format!("<b>{title}</b> over {x}.{}", page::legend(legend)))?;
        }
    }
    Ok(section)
}

/// One line per schedule and material, the base material last and in full colour.
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
                lines.push(Line::new(rows.map(|r| (along(r), error(r))).collect(), color));
            }
        }
    }
    lines
}

fn failures(cases: &[&ConvergenceCase]) -> Vec<String> {
    let failed = cases.iter().filter_map(|c| c.failure.as_ref().map(|why| (c, why)));
    failed.map(|(c, why)| format!("{} kPa, nu {}: {why}", c.young_kpa, c.poisson)).collect()
}

/// All cases with the default iterations of the schedules.
fn default_iterations(result: &ConvergenceResult) -> Section {
    let scientific = |v: Option<f64>| v.map_or("\u{2013}".to_owned(), |v| format!("{v:.1e}"));
    let rows = result.cases.iter().flat_map(|case| case.rows.iter().filter(|r| r.own).map(move |r| (case, r)));
    let table = Table::of(
        rows,
        &[
            ("Scene", &|(case, _)| case.scene.clone()),
            ("E (kPa)", &|(case, _)| case.young_kpa.to_string()),
            ("nu", &|(case, _)| case.poisson.to_string()),
            ("Schedule", &|(_, r)| r.schedule.clone()),
            ("Iterations", &|(_, r)| r.iterations.to_string()),
            ("ms", &|(_, r)| fixed(r.wall_ms, 3)),
            ("RMS error (\u{b5}m)", &|(_, r)| format!("{:.2e}", r.position_error_um)),
            ("over displacement", &|(_, r)| scientific(Some(r.position_error))),
            ("Energy", &|(_, r)| scientific(r.energy_error)),
            ("Inverted", &|(_, r)| r.inverted.to_string()),
        ],
    );
    Section::new(
        "With the default iterations of each schedule",
        "One substep. <i>Over displacement</i>: over the RMS distance from the rest shape. <i>Energy</i>: the \
         incremental potential above the minimum, over that of the inertial predictor; single precision limits it to \
         about 1e-10. The plots show 12 kPa and nu 0.45 in full colour and the other materials pale.",
    )
    .table(table)
}
