//! One substep of a scene from the same state with 1, 2, 4, ... iterations: error against the
//! minimum found by the oracle, and wall time.

use crate::Result;
use crate::scenes::{BenchScene, FRAME, OracleRun, grasps, reference, rest_positions, tools};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use trocar_core::Progress;
use trocar_tissue::{Descent, QuasiNewton, SolverSettings, State, Stepper, ToolMotion};
use trocar_tissue_reference::OracleState;
use trocar_workflow::{check_interrupted, solver_named};

/// Oracle steps per frame before the measured substep.
const ORACLE_SUBSTEPS: usize = 4;

/// Repetitions of a timed substep.
const REPEATS: usize = 5;

/// The excess energy of the predictor is used above this share of the kinetic energy that gravity
/// adds in a substep.
const MIN_EXCESS: f64 = 1e-4;

/// One schedule with one number of iterations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepRow {
    /// Name of the schedule.
    pub schedule: String,
    /// Iterations of the substep.
    pub iterations: usize,
    /// Whether this is the default number of the schedule.
    pub own: bool,
    /// Length of the substep (ms).
    pub substep_ms: f64,
    /// Least wall time of five substeps on one thread (ms).
    pub wall_ms: f64,
    /// RMS distance of the nodes from the oracle's (um).
    pub position_error_um: f64,
    /// The same over the RMS displacement from the rest shape.
    pub position_error: f64,
    /// Incremental potential above the oracle's (J); none with an inverted element.
    pub energy_error_j: Option<f64>,
    /// The same over that of the inertial predictor; none if the predictor is as good as the
    /// minimum.
    pub energy_error: Option<f64>,
    /// Number of inverted elements.
    pub inverted: usize,
}

/// Frames of the scene before the substep; none for the static equilibrium.
fn frames_before(scene: &str) -> Option<usize> {
    match scene {
        "sag" => None,
        "drag" => Some(12),
        // A quarter into the second period.
        "shake" => Some(10),
        "tube" => Some(15),
        _ => Some(6),
    }
}

/// Measures all rows of a scene.
pub(super) fn measure(
    scene: &BenchScene,
    solvers: &[&str],
    max: usize,
    progress: &dyn Progress,
) -> Result<Vec<StepRow>> {
    let mut run = OracleRun::new(scene);
    let h = FRAME / ORACLE_SUBSTEPS as f64;
    let mut before = run.state.clone();
    let frames = frames_before(scene.name);
    match frames {
        None => {
            run.settle()?;
            before = run.state.clone();
        }
        Some(frames) => {
            for k in 0..frames * ORACLE_SUBSTEPS {
                check_interrupted(progress)?;
                before = run.state.clone();
                run.step(h, (k + 1) as f64 * h)?;
            }
        }
    }
    let mut start = run.state.to_state(&scene.model, &before, h).map_err(reference)?;
    start.grasps = grasps(scene, &State::new(&scene.model));
    let mut rows = Vec::new();
    for name in solvers {
        let schedule = solver_named(name)?;
        let ladder = Ladder::new(scene, &mut run, &start, frames.unwrap_or(0) as f64 * FRAME, schedule)?;
        for iterations in iteration_counts(schedule, max) {
            check_interrupted(progress)?;
            rows.push(ladder.row(&mut run, name, schedule, iterations)?);
        }
    }
    Ok(rows)
}

/// 1, 2, 4, ... and the default number of the schedule.
fn iteration_counts(schedule: SolverSettings, max: usize) -> Vec<usize> {
    let doubling = std::iter::successors(Some(1_usize), |k| k.checked_mul(2)).take_while(|k| *k <= max);
    let mut all: Vec<usize> = doubling.chain([default_iterations(schedule)]).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Default iterations of a substep of the schedule.
fn default_iterations(schedule: SolverSettings) -> usize {
    match schedule {
        SolverSettings::Descent(descent) => descent.iterations,
        SolverSettings::QuasiNewton(method) => method.iterations,
    }
}

/// One substep of the schedule with this number of iterations and no early exit.
fn one_substep(schedule: SolverSettings, iterations: usize) -> SolverSettings {
    match schedule {
        SolverSettings::Descent(descent) => SolverSettings::Descent(Descent { substeps: 1, iterations, ..descent }),
        SolverSettings::QuasiNewton(method) => {
            SolverSettings::QuasiNewton(QuasiNewton { substeps: 1, iterations, tolerance: 0.0, ..method })
        }
    }
}

/// Shared by the rows of a schedule.
struct Ladder<'a> {
    scene: &'a BenchScene,
    start: &'a State,
    /// The start state of the oracle, rounded like the stepper's.
    before: OracleState,
    /// The minimum.
    truth: OracleState,
    energy: f64,
    /// Energy of the inertial predictor above the minimum (J); none if the predictor is as good.
    predictor_excess: Option<f64>,
    /// RMS displacement from rest at the minimum (m).
    displacement: f64,
    tools: Vec<ToolMotion>,
    /// Held nodes: body and node.
    held: Vec<(usize, usize)>,
    h: f64,
}

impl<'a> Ladder<'a> {
    fn new(
        scene: &'a BenchScene,
        run: &mut OracleRun<'_>,
        start: &'a State,
        time: f64,
        schedule: SolverSettings,
    ) -> Result<Self> {
        let h = FRAME / schedule.substeps() as f64;
        let before = OracleState::from_state(&scene.model, start);
        let held = run.held_between_frames(time + h);
        let mut truth = before.clone();
        run.oracle().step(&scene.model, &mut truth, h, &held).map_err(reference)?;
        let mut predictor = before.clone();
        for (b, body) in scene.model.bodies().iter().enumerate() {
            for i in (0..body.len()).filter(|i| !body.pinned()[*i]) {
                predictor.positions_mut(b)[i] += h * before.velocities(b)[i] + h * h * scene.model.gravity();
            }
        }
        held.iter().for_each(|n| predictor.positions_mut(n.body)[n.node as usize] = n.target);
        let total = |run: &mut OracleRun<'_>, state: &OracleState| -> Result<f64> {
            Ok(run.oracle().energy(&scene.model, &before, state, h).map_err(reference)?.iter().sum())
        };
        let energy = total(run, &truth)?;
        let predictor_excess = total(run, &predictor)? - energy;
        let bodies = scene.model.bodies().iter();
        let mass: f64 = bodies.map(|b| (0..b.len()).map(|i| b.mass(i)).sum::<f64>()).sum();
        let least = MIN_EXCESS * 0.5 * mass * (h * scene.model.gravity()).length_squared();
        let along = tools(scene, time, time + FRAME);
        let share = h / FRAME;
        let displacement = rms(&positions(scene, &truth), &rest_positions(&scene.model));
        Ok(Self {
            scene,
            start,
            energy,
            predictor_excess: Some(predictor_excess).filter(|e| e.is_finite() && *e > least),
            displacement,
            tools: along.iter().map(|t| ToolMotion { from: t.from, to: t.at(share) }).collect(),
            held: held.iter().map(|n| (n.body, n.node as usize)).collect(),
            before,
            truth,
            h,
        })
    }

    fn row(&self, run: &mut OracleRun<'_>, name: &str, schedule: SolverSettings, iterations: usize) -> Result<StepRow> {
        let model = &self.scene.model;
        let mut stepper = Stepper::new(model, one_substep(schedule, iterations), self.h, 1)?;
        let mut state = self.start.clone();
        let report = stepper.step(model, &mut state, &self.tools);
        let mut times = Vec::with_capacity(REPEATS);
        for _ in 0..REPEATS {
            let mut again = self.start.clone();
            let clock = Instant::now();
            stepper.step(model, &mut again, &self.tools);
            times.push(1e3 * clock.elapsed().as_secs_f64());
        }
        let mut reached = OracleState::from_state(model, &state);
        let error = rms(&positions(self.scene, &reached), &positions(self.scene, &self.truth));
        // The rounding of held nodes is no error of the solver, but would dominate the energy.
        for (body, node) in &self.held {
            reached.positions_mut(*body)[*node] = self.truth.positions(*body)[*node];
        }
        let energy: f64 = run.oracle().energy(model, &self.before, &reached, self.h).map_err(reference)?.iter().sum();
        let excess = Some(energy - self.energy).filter(|e| e.is_finite());
        Ok(StepRow {
            schedule: name.to_owned(),
            iterations,
            own: iterations == default_iterations(schedule),
            substep_ms: 1e3 * self.h,
            wall_ms: times.iter().copied().fold(f64::INFINITY, f64::min),
            position_error_um: 1e6 * error,
            position_error: error / self.displacement,
            energy_error_j: excess,
            energy_error: excess.zip(self.predictor_excess).map(|(e, all)| e / all),
            inverted: report.inverted,
        })
    }
}

fn positions(scene: &BenchScene, state: &OracleState) -> Vec<DVec3> {
    (0..scene.model.bodies().len()).flat_map(|b| state.positions(b).iter().copied()).collect()
}

fn rms(a: &[DVec3], b: &[DVec3]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum();
    (sum / a.len().max(1) as f64).sqrt()
}
