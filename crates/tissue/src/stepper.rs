//! One frame of simulation: every body by its solver, and what it did to the tools.

use crate::crew::{Crew, Workers};
use crate::descent::TouchingDescent;
use crate::external::{ExternalSolver, Integrator};
use crate::integrator::Frame;
use crate::quasi_newton::QuasiNewtonSolver;
use crate::report::Divergence;
use crate::{Body, Error, Event, Load, Model, Result, SolverSettings, State, StepReport, ToolForce, ToolMotion};
use glam::DVec3;

/// Advances states of one model; owns all scratch memory, so stepping allocates nothing, but for lists of what bodies touch that get longer than they ever were.
pub struct Stepper {
    dt: f64,
    /// Whether a single body is worth several threads.
    threaded_bodies: bool,
    threads: usize,
    /// None: the calling thread does the work.
    pool: Option<rayon::ThreadPool>,
    crew: Box<dyn Crew>,
    forces: Vec<ToolForce>,
    events: Vec<Event>,
}

impl Stepper {
    /// Prepares to step frames of `dt` (s) with `threads` worker threads (0: one for each core).
    /// The results do not depend on the number of threads.
    ///
    /// # Errors
    /// Settings or a `dt` out of range, or threads that the system does not give.
    pub fn new(model: &Model, settings: SolverSettings, dt: f64, threads: usize) -> Result<Self> {
        settings.check()?;
        let threaded_bodies = matches!(settings, SolverSettings::Descent(_));
        Self::with_crew(model, crew(settings, dt), threaded_bodies, dt, threads)
    }

    /// Prepares to step with an integrator from outside this crate: `make` makes the one of each
    /// body. Bodies then pass through each other and through tools.
    ///
    /// # Errors
    /// A `dt` out of range, or threads that the system does not give.
    pub fn with_integrator(
        model: &Model,
        make: impl Fn(&Body) -> Box<dyn Integrator> + Send + Sync + 'static,
        dt: f64,
        threads: usize,
    ) -> Result<Self> {
        let crew = Workers::new(move |body, _| ExternalSolver::new(make(body)));
        Self::with_crew(model, Box::new(crew), false, dt, threads)
    }

    fn with_crew(model: &Model, crew: Box<dyn Crew>, threaded_bodies: bool, dt: f64, threads: usize) -> Result<Self> {
        if !(dt > 0.0 && dt <= 10.0) {
            return Err(Error::Model(format!("a frame of {dt} s; must be in (0, 10]")));
        }
        let (forces, events) = (Vec::new(), Vec::new());
        let mut stepper = Self { dt, threaded_bodies, threads, pool: None, crew, forces, events };
        stepper.set_model(model)?;
        Ok(stepper)
    }

    /// Goes over to another `model`, such as that of before or after a cut ([`crate::sever`]). What both have in common keeps its solver; only the other bodies are prepared, but where bodies touch, all pairs are measured at rest anew. States
    /// of the new model go on with the same bits as in a new stepper.
    ///
    /// # Errors
    /// Threads that the system does not give; the stepper still steps the old model then.
    pub fn set_model(&mut self, model: &Model) -> Result<()> {
        // Handing a small model over to a pool would cost more than some frames do.
        let one = !self.threaded_bodies && model.bodies.len() == 1;
        let alone = self.threads == 1 || one;
        if alone {
            self.pool = None;
        } else if self.pool.is_none() {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
            self.pool =
                Some(pool.map_err(|e| Error::Model(format!("{} threads cannot be started: {e}", self.threads)))?);
        }
        self.crew.set_model(model, alone);
        Ok(())
    }

    /// What tissue did to each tool in the last frame, in the order of the motions that were given.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// What happened to grasps in the last frame.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// What tools and other bodies did to nodes at the end of the last frame, which left `state`: the loads that would do the same throughout a frame that ends there. Supports and grasps are left out.
    pub fn contact_loads(&self, model: &Model, state: &State) -> Vec<Load> {
        let mut loads = Vec::new();
        if self.crew.fits(model, state) {
            self.crew.for_contact(state, &mut |body, vertex, force| loads.push((body, vertex, force)));
        }
        let nodes: Vec<Vec<usize>> = model.bodies.iter().map(crate::Body::nodes_of_vertices).collect();
        let load =
            |(body, vertex, force): (usize, u32, DVec3)| Load { body, node: nodes[body][vertex as usize], force };
        loads.into_iter().map(load).collect()
    }

    /// Advances `state` by one frame. `tools` are the motions of the tools that carry the state's grasps; what is held by a tool without a motion stays where it is.
    pub fn step(&mut self, model: &Model, state: &mut State, tools: &[ToolMotion]) -> StepReport {
        self.step_with_loads(model, state, tools, &[])
    }

    /// The same under `loads` on nodes.
    pub fn step_with_loads(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        loads: &[Load],
    ) -> StepReport {
        self.events.clear();
        self.forces.clear();
        let refused = |why| StepReport { divergence: Some(why), ..StepReport::default() };
        if !self.crew.fits(model, state) || !state.grasps_fit(model) {
            return refused(Divergence::OtherModel);
        }
        if !loads.iter().all(|load| load.fits(model)) {
            return refused(Divergence::WrongLoad);
        }
        let grasps = std::mem::take(&mut state.grasps);
        let (gravity, colliders) = (model.gravity, &model.colliders[..]);
        let alone = self.pool.is_none();
        let frame = Frame { dt: self.dt, gravity, index: 0, grasps: &grasps, tools, loads, colliders, alone };
        let report = self.crew.advance(model, state, &frame, self.pool.as_ref());
        state.grasps = grasps;
        if !matches!(report.divergence, Some(Divergence::NonFinite { .. })) {
            state.time += self.dt;
            self.tell_tools(state, tools.len());
        }
        report
    }

    /// Sums up what the bodies did to the tools, and lets grasps slip and tear.
    fn tell_tools(&mut self, state: &mut State, tools: usize) {
        let Self { crew, forces, events, .. } = self;
        forces.clear();
        forces.resize(tools, ToolForce::default());
        crew.for_bodies(&mut |_, reaction, contacts| {
            forces.iter_mut().zip(reaction.forces()).for_each(|(sum, part)| sum.add(part));
            let Some(contacts) = contacts else { return };
            forces.iter_mut().zip(contacts.forces()).for_each(|(sum, part)| sum.add(part));
            for held in contacts.hanging() {
                state.grasps[held.grasp as usize].slid[held.node as usize] = held.slid;
            }
        });
        for (g, grasp) in state.grasps.iter_mut().enumerate() {
            crew.for_bodies(&mut |body, _, contacts| {
                if let Some(contacts) = contacts.filter(|_| body == grasp.body) {
                    let held = contacts.hanging().iter().filter(|held| held.grasp as usize == g);
                    grasp.judge(held, events);
                }
            });
        }
    }
}

/// The solvers of these settings.
fn crew(settings: SolverSettings, dt: f64) -> Box<dyn Crew> {
    match settings {
        SolverSettings::QuasiNewton(method) => {
            Box::new(Workers::new(move |body, alone| QuasiNewtonSolver::new(method, body, dt, alone)))
        }
        SolverSettings::Descent(descent) => {
            Box::new(Workers::new(move |body, alone| TouchingDescent::new(descent, body, alone)))
        }
    }
}
