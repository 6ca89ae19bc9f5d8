//! Fig. 6(b): which integrators stay bounded when specimen A is released under gravity, and how far each comes to rest from the true equilibrium.

use super::integrator_forms::{Form, forms};
use crate::{Error, Result, pages};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use trocar_cell::World;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_testing::scenes::{FRAME, Organs, Scene, material, mean_error, rest_positions};
use trocar_tissue::{Model, SolverSettings, State};
use trocar_tissue_reference::{Oracle, OracleState, stable_explicit_step};
use trocar_workflow::REPORT;
use trocar_workflow::phantoms;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "integrators.json";

/// Speed at which a node has diverged [m/s], the paper's limit.
pub(crate) const SPEED_LIMIT: f64 = 20.0;

/// The last share of the run, over which positions are averaged before they are compared with the equilibrium: tissue that is not damped swings around it.
const MEASURED_SHARE: f64 = 1.0 / 3.0;

/// Viscosity over Young's modulus [s]: less than in the cell, where the explicit forms would need shorter steps than their elasticity asks for.
const LIGHT_DAMPING: f64 = 0.02 / 15.0;

/// Young's modulus [Pa] and Poisson's ratio of organs out of a file.
const TISSUE: (f64, f64) = (12e3, 0.45);

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct IntegratorsExperiment {
    /// A Gmsh file with the organs, the lowest 42% of each pinned; phantom A, recorded, reconstructed and put into the cell, without one.
    pub mesh: Option<PathBuf>,
    /// How phantom A is filmed.
    pub record: RecordOptions,
    /// Simulated time [s].
    pub seconds: f64,
    /// Leave dashpots out.
    pub undamped: bool,
    /// Worker threads, 0 for all.
    pub threads: usize,
}

/// One integrator.
#[derive(Clone, Debug, Serialize)]
pub struct IntegratorRow {
    /// Its name.
    pub name: &'static str,
    /// Its settings.
    pub settings: String,
    /// What the paper says of it.
    pub paper: &'static str,
    /// It ran to the end and no node came to the speed limit.
    pub bounded: bool,
    /// What ended it, if anything did.
    pub event: Option<String>,
    /// The time at whose frame it ended [s].
    pub ended_at_s: Option<f64>,
    /// Greatest node speed at the end of any frame [m/s]; at the speed limit where it reached that.
    pub peak_speed_m_s: f64,
    /// Greatest node speed in the last frame [m/s].
    pub last_speed_m_s: f64,
    /// Mean distance of the nodes from the static equilibrium over their mean displacement in it, positions averaged over the last third of the run; none if it diverged.
    pub sag_error: Option<f64>,
    /// Mean displacement over the equilibrium's.
    pub sag_ratio: Option<f64>,
    /// Median wall time of a frame [ms].
    pub frame_ms: f64,
    /// Time [s] and greatest node speed [m/s], frame by frame.
    pub speeds: Vec<(f64, f64)>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct IntegratorsResult {
    /// Every integrator.
    pub integrators: Vec<IntegratorRow>,
    /// What the data say, in a sentence each.
    pub findings: Vec<String>,
    /// The longest stable step of explicit integration [us].
    pub stable_step_us: f64,
    /// Where the organs are from.
    pub specimen: String,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub tets: usize,
    /// Mean displacement of the nodes in the static equilibrium [mm].
    pub sag_mm: f64,
    /// Whether dashpots were left out.
    pub undamped: bool,
    /// Worker threads.
    pub threads: usize,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl IntegratorsExperiment {
    /// Runs everything into the folder `output`.
    ///
    /// # Errors
    /// Organs or a folder that cannot be had, an equilibrium that is not found, an interruption. An integrator that diverges is a row that says so.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<IntegratorsResult> {
        let clock = Instant::now();
        if !(self.seconds >= 3.0 * FRAME && self.seconds <= 60.0) {
            return Err(Error::Mismatch(format!("{} s are to be simulated; 0.05 to 60 make sense", self.seconds)));
        }
        let organs = self.mesh.as_deref().map(Organs::read).transpose()?;
        super::claim(output, MARKER)?;
        let (specimen, model) = match &organs {
            Some(organs) => (organs.source.clone(), self.pinned(organs)?),
            None => ("phantom A, reconstructed".to_owned(), self.phantom(output, progress)?),
        };
        let truth = Equilibrium::of(&model)?;
        let stable = stable_explicit_step(&model);
        let forms = forms(&model, FRAME);
        let frames = (self.seconds / FRAME).round() as usize;
        progress.begin("frames", (forms.len() * frames) as u64);
        let mut integrators = Vec::with_capacity(forms.len());
        for form in forms {
            integrators.push(measured(form, &model, &truth, frames, self.threads, progress)?);
        }
        progress.end();
        let result = IntegratorsResult {
            findings: super::integrator_forms::findings(&integrators),
            integrators,
            stable_step_us: 1e6 * stable,
            specimen,
            nodes: model.bodies().iter().map(trocar_tissue::Body::len).sum(),
            tets: model.bodies().iter().map(|b| b.tets().len()).sum(),
            sag_mm: 1e3 * truth.sag,
            undamped: self.undamped,
            threads: if self.threads == 0 { rayon::current_num_threads() } else { self.threads },
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::integrators(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    /// Organs of a file, the lowest 42% of each one's nodes pinned.
    fn pinned(&self, organs: &Organs) -> Result<Model> {
        let tissue = material(TISSUE.0, TISSUE.1);
        let viscosity = if self.undamped { 0.0 } else { LIGHT_DAMPING * TISSUE.0 };
        Ok(Scene::sag(organs, trocar_tissue::Material { viscosity, ..tissue })?.model)
    }

    /// Phantom A as the cell has it.
    fn phantom(&self, output: &Path, progress: &dyn Progress) -> Result<Model> {
        if self.undamped {
            return Err(Error::Mismatch("the cell's organs are damped; name a mesh for undamped ones".to_owned()));
        }
        let specimen = phantoms::specimen("phantom-a", &self.record, &output.join("phantom-a"), progress)?;
        Ok(World::new(&specimen, SolverSettings::default(), 1)?.model)
    }
}

/// Where the organs come to rest in truth.
struct Equilibrium {
    rest: Vec<DVec3>,
    positions: Vec<DVec3>,
    /// Mean displacement [m].
    sag: f64,
}

impl Equilibrium {
    fn of(model: &Model) -> Result<Self> {
        let mut state = OracleState::new(model);
        Oracle::new(model).settle(model, &mut state, &[])?;
        let rest = rest_positions(model);
        let positions: Vec<DVec3> =
            (0..model.bodies().len()).flat_map(|b| state.positions(b).iter().copied()).collect();
        let sag = rest.iter().zip(&positions).map(|(a, b)| (*a - *b).length()).sum::<f64>() / rest.len() as f64;
        Ok(Self { rest, positions, sag })
    }
}

fn measured(
    form: Form,
    model: &Model,
    truth: &Equilibrium,
    frames: usize,
    threads: usize,
    progress: &dyn Progress,
) -> Result<IntegratorRow> {
    let mut stepper = form.scheme.stepper(model, FRAME, threads)?;
    let mut state = State::new(model);
    let mut mean = vec![DVec3::ZERO; truth.rest.len()];
    let first_measured = frames - ((MEASURED_SHARE * frames as f64) as usize).max(1);
    let (mut speeds, mut times, mut ended) = (Vec::with_capacity(frames), Vec::with_capacity(frames), None);
    for frame in 0..frames {
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
        let clock = Instant::now();
        let report = stepper.step(model, &mut state, &[]);
        times.push(1e3 * clock.elapsed().as_secs_f64());
        progress.advance(1);
        let end = (frame + 1) as f64 * FRAME;
        // A state that is not a number has no speed: it is over the limit all the same.
        let lost = matches!(report.divergence, Some(trocar_tissue::Divergence::NonFinite { .. }));
        speeds.push((end, if lost { SPEED_LIMIT } else { report.max_speed.min(SPEED_LIMIT) }));
        if let Some(event) = report.divergence {
            ended = Some((end, event.to_string()));
            progress.advance((frames - frame - 1) as u64);
            break;
        }
        if frame >= first_measured {
            let all = (0..model.bodies().len()).flat_map(|b| state.positions(model, b));
            mean.iter_mut().zip(all).for_each(|(sum, x)| *sum += x / (frames - first_measured) as f64);
        }
    }
    times.sort_by(f64::total_cmp);
    let moved = || mean.iter().zip(&truth.rest).map(|(a, b)| (*a - *b).length()).sum::<f64>() / mean.len() as f64;
    Ok(IntegratorRow {
        name: form.name,
        settings: form.settings,
        paper: form.paper,
        bounded: ended.is_none(),
        peak_speed_m_s: speeds.iter().map(|s| s.1).fold(0.0, f64::max),
        last_speed_m_s: speeds.last().map_or(0.0, |s| s.1),
        sag_error: ended.is_none().then(|| mean_error(&mean, &truth.positions, &truth.rest)),
        sag_ratio: ended.is_none().then(|| moved() / truth.sag),
        ended_at_s: ended.as_ref().map(|e| e.0),
        event: ended.map(|e| e.1),
        frame_ms: times[times.len() / 2],
        speeds,
    })
}
