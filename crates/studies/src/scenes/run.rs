//! Runs of a scene by a solver and by the oracle.

use super::scene::{BenchScene, FRAME, Patch};
use crate::{Error, Result};
use glam::DVec3;
use trocar_tissue::{Grasp, Model, SolverSettings, State, StepReport, Stepper, ToolMotion};
use trocar_tissue_reference::{Held, Oracle, OracleState};

/// A run of a scene by a solver, frame by frame.
pub struct Run<'a> {
    scene: &'a BenchScene,
    stepper: Stepper,
    /// The present state.
    pub state: State,
    /// Number of frames so far.
    frames: usize,
}

impl<'a> Run<'a> {
    /// A run that begins with resting organs in their rest shapes and grasped patches.
    ///
    /// # Errors
    /// Invalid solver settings, threads that cannot start.
    pub fn new(scene: &'a BenchScene, schedule: SolverSettings, threads: usize) -> Result<Self> {
        let stepper = Stepper::new(&scene.model, schedule, FRAME, threads)?;
        let mut state = State::new(&scene.model);
        state.grasps = grasps(scene, &state);
        Ok(Self { scene, stepper, state, frames: 0 })
    }

    /// Advances by a frame of 1/60 s.
    ///
    /// # Errors
    /// A state that diverged.
    pub fn frame(&mut self) -> Result<StepReport> {
        let (from, to) = (self.frames as f64 * FRAME, (self.frames + 1) as f64 * FRAME);
        let report = self.stepper.step(&self.scene.model, &mut self.state, &tools(self.scene, from, to));
        self.frames += 1;
        match report.divergence {
            None => Ok(report),
            Some(why) => Err(Error::Study(format!("scene '{}', frame {}: {why}", self.scene.name, self.frames).into())),
        }
    }

    /// World positions of the nodes of all bodies, one body after the other (m).
    pub fn positions(&self) -> Vec<DVec3> {
        let model = &self.scene.model;
        (0..model.bodies().len()).flat_map(|b| self.state.positions(model, b)).collect()
    }
}

/// Grasps of a scene's patches in `state`, with the tools at the start of their paths.
pub fn grasps(scene: &BenchScene, state: &State) -> Vec<Grasp> {
    let grasp = |(tool, patch): (usize, &Patch)| {
        Grasp::capture(&scene.model, state, patch.body, &patch.nodes, tool, &patch.motion.pose(0.0))
    };
    scene.patches.iter().enumerate().map(grasp).collect()
}

/// Motions of the tools between two times (s).
pub fn tools(scene: &BenchScene, from: f64, to: f64) -> Vec<ToolMotion> {
    scene.patches.iter().map(|p| ToolMotion { from: p.motion.pose(from), to: p.motion.pose(to) }).collect()
}

/// An error of the oracle or of a comparator, as one of a study.
pub(crate) fn reference(error: trocar_tissue_reference::Error) -> Error {
    Error::Study(error.into())
}

/// A run of a scene by the oracle, substep by substep.
pub struct OracleRun<'a> {
    scene: &'a BenchScene,
    oracle: Oracle,
    grasps: Vec<Grasp>,
    /// The present state.
    pub state: OracleState,
}

impl<'a> OracleRun<'a> {
    /// A run that begins as [`Run`] does.
    pub fn new(scene: &'a BenchScene) -> Self {
        let grasps = grasps(scene, &State::new(&scene.model));
        Self { scene, oracle: Oracle::new(&scene.model), grasps, state: OracleState::new(&scene.model) }
    }

    /// Prescribed positions of held nodes at `time` (s).
    pub fn held(&self, time: f64) -> Vec<Held> {
        let of = |grasp: &Grasp| Held::by(grasp, &self.scene.patches[grasp.tool].motion.pose(time));
        self.grasps.iter().flat_map(of).collect()
    }

    /// Advances by a step of `dt` (s) that ends at `end` (s). Tools move in straight lines between
    /// frames, as those of a stepper.
    ///
    /// # Errors
    /// A step that fails.
    pub fn step(&mut self, dt: f64, end: f64) -> Result<()> {
        let held = self.held_between_frames(end);
        self.oracle.step(&self.scene.model, &mut self.state, dt, &held).map_err(reference)?;
        Ok(())
    }

    /// As [`Self::held`], but in straight lines between frames.
    pub fn held_between_frames(&self, time: f64) -> Vec<Held> {
        let frames = time / FRAME;
        // Rounding must not move the end of a frame into the next one.
        let whole = (frames + 1e-9).floor();
        let motions = tools(self.scene, whole * FRAME, (whole + 1.0) * FRAME);
        let of = |grasp: &Grasp| Held::by(grasp, &motions[grasp.tool].at((frames - whole).max(0.0)));
        self.grasps.iter().flat_map(of).collect()
    }

    /// Finds the static equilibrium with held nodes at the start of their paths.
    ///
    /// # Errors
    /// An equilibrium that is not found.
    pub fn settle(&mut self) -> Result<()> {
        let held = self.held(0.0);
        self.oracle.settle(&self.scene.model, &mut self.state, &held).map_err(reference)?;
        Ok(())
    }

    /// The oracle, for energies.
    pub fn oracle(&mut self) -> &mut Oracle {
        &mut self.oracle
    }

    /// World positions of the nodes of all bodies, one body after the other (m).
    pub fn positions(&self) -> Vec<DVec3> {
        (0..self.scene.model.bodies().len()).flat_map(|b| self.state.positions(b).iter().copied()).collect()
    }
}

/// Rest positions of the nodes of all bodies, one body after the other (m).
pub fn rest_positions(model: &Model) -> Vec<DVec3> {
    model.bodies().iter().flat_map(|b| b.rest_positions().iter().copied()).collect()
}
