//! How fast solvers converge: one substep of each scene from the same state with more and more iterations, against the oracle's minimum.

use super::step_ladder::{self, StepRow};
use crate::bench::OrganSource;
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_core::Progress;
use trocar_testing::scenes::{Organs, SCENES, Scene, material};
use trocar_workflow::REPORT;
use trocar_workflow::SOLVERS;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "convergence.json";

/// The folder of finished cases in it.
const CASES: &str = "cases";

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct ConvergenceExperiment {
    /// The organs, of which the appendix is used; `Analytic` counts the elements of the appendix alone.
    pub organs: OrganSource,
    /// Names of scenes, of [`SCENES`].
    pub scenes: Vec<String>,
    /// Young's moduli [Pa].
    pub young_moduli: Vec<f64>,
    /// Poisson's ratios.
    pub poisson_ratios: Vec<f64>,
    /// Most iterations; they double from 1 to this.
    pub most_iterations: usize,
}

impl Default for ConvergenceExperiment {
    fn default() -> Self {
        Self {
            organs: OrganSource::Analytic(2_500),
            scenes: SCENES.map(str::to_owned).into(),
            young_moduli: vec![3e3, 12e3, 48e3],
            poisson_ratios: vec![0.3, 0.45, 0.49],
            most_iterations: 512,
        }
    }
}

/// A scene with a material: what is kept when the experiment is interrupted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConvergenceCase {
    /// The scene.
    pub scene: String,
    /// Young's modulus [kPa].
    pub young_kpa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Why there are no rows, if there are none.
    pub failure: Option<String>,
    /// Every schedule with every number of iterations.
    pub rows: Vec<StepRow>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceResult {
    /// Every scene with every material.
    pub cases: Vec<ConvergenceCase>,
    /// The schedules' names.
    pub schedules: Vec<String>,
    /// Where the appendix is from.
    pub mesh: String,
    /// Its elements.
    pub tets: usize,
    /// Its nodes.
    pub nodes: usize,
    /// Cases that an earlier run had finished.
    pub reused: usize,
    /// Wall time of this run [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// A finished case on disk.
#[derive(Serialize, Deserialize)]
struct Finished {
    /// What it depends on besides its scene and material.
    settings: String,
    case: ConvergenceCase,
}

impl ConvergenceExperiment {
    /// Runs every case that the folder `output` does not hold yet, and writes the report. Finished cases are kept when it is interrupted.
    ///
    /// # Errors
    /// Organs that cannot be had, unknown scenes, a folder that cannot be written, an interruption. A case that cannot be run is one that says why.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ConvergenceResult> {
        let clock = Instant::now();
        if let Some(name) = self.scenes.iter().find(|s| !SCENES.contains(&s.as_str())) {
            return Err(Error::Mismatch(format!("there is no scene '{name}'; there are {}", SCENES.join(", "))));
        }
        let organs = match &self.organs {
            OrganSource::File(path) => Organs::read(path)?.only_appendix(),
            OrganSource::Analytic(tets) => Organs::analytic_appendix(*tets)?,
        };
        super::claim(output, MARKER)?;
        let folder = output.join(CASES);
        std::fs::create_dir_all(&folder).map_err(|source| Error::Io { path: folder.clone(), source })?;
        let settings = self.settings(&organs)?;
        let total = self.scenes.len() * self.young_moduli.len() * self.poisson_ratios.len();
        progress.begin("cases", total as u64);
        let (mut cases, mut reused) = (Vec::with_capacity(total), 0);
        for scene in &self.scenes {
            for young in &self.young_moduli {
                for poisson in &self.poisson_ratios {
                    let path = folder.join(format!("{scene}-{}kPa-{poisson}.json", young / 1e3));
                    let case = match earlier(&path, &settings) {
                        Some(case) => {
                            reused += 1;
                            case
                        }
                        None => {
                            let case = self.case(&organs, scene, *young, *poisson, progress)?;
                            let finished = Finished { settings: settings.clone(), case };
                            write_json(&path, &finished)?;
                            finished.case
                        }
                    };
                    cases.push(case);
                    progress.advance(1);
                }
            }
        }
        progress.end();
        let result = ConvergenceResult {
            cases,
            schedules: SOLVERS.map(str::to_owned).into(),
            mesh: organs.source.clone(),
            tets: organs.tets(),
            nodes: organs.nodes(),
            reused,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        let html = pages::convergence(&result)?;
        super::write(&output.join(REPORT), html.as_bytes())?;
        write_json(&output.join(MARKER), &result)?;
        Ok(result)
    }

    fn case(
        &self,
        organs: &Organs,
        scene: &str,
        young: f64,
        poisson: f64,
        progress: &dyn Progress,
    ) -> Result<ConvergenceCase> {
        let made = Scene::named(scene, organs, material(young, poisson))
            .map_err(Error::from)
            .and_then(|scene| step_ladder::climb(&scene, &SOLVERS, self.most_iterations, progress));
        let (rows, failure) = match made {
            Ok(rows) => (rows, None),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => (Vec::new(), Some(why.to_string())),
        };
        Ok(ConvergenceCase { scene: scene.to_owned(), young_kpa: young / 1e3, poisson, failure, rows })
    }

    /// What rows depend on besides scene and material.
    fn settings(&self, organs: &Organs) -> Result<String> {
        let schedules =
            SOLVERS.iter().map(|s| trocar_workflow::solver_named(s)).collect::<std::result::Result<Vec<_>, _>>()?;
        Ok(format!(
            "{} with {} nodes and {} tets, to {} iterations, {schedules:?}, version {}",
            organs.source,
            organs.nodes(),
            organs.tets(),
            self.most_iterations,
            env!("CARGO_PKG_VERSION")
        ))
    }
}

/// A case that an earlier run finished with the same settings.
fn earlier(path: &PathBuf, settings: &str) -> Option<ConvergenceCase> {
    let finished: Finished = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    (finished.settings == settings).then_some(finished.case)
}

/// Writes beside the place and moves there, so that an interruption leaves no half of it.
fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let bytes = serde_json::to_vec_pretty(value).map_err(|e| Error::Format(e.to_string()))?;
    let beside = path.with_extension("part");
    super::write(&beside, &bytes)?;
    std::fs::rename(&beside, path).map_err(|source| Error::Io { path: path.to_owned(), source })
}
