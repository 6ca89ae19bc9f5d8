//! One frame of simulation: every body by its solver, bodies in parallel.

use crate::comparator::ComparatorIntegrator;
use crate::contact::Reaction;
use crate::descent::TouchingDescent;
use crate::integrator::{Frame, Integrator};
use crate::oracle::NewtonIntegrator;
use crate::quasi_newton::QuasiNewtonIntegrator;
use crate::report::Divergence;
use crate::schedule::{Descent, Start};
use crate::state::BodyState;
use crate::untangle::Untangler;
use crate::{Body, Error, Event, Model, Result, Schedule, State, StepReport, ToolForce, ToolMotion};
use rayon::prelude::*;

/// Advances states of one model; owns all scratch memory, so stepping allocates nothing.
pub struct Stepper {
    dt: f64,
    schedule: Schedule,
    threads: usize,
    /// None: the calling thread does the work.
    pool: Option<rayon::ThreadPool>,
    /// Largest first, so that the threads end together.
    workers: Vec<Worker>,
    forces: Vec<ToolForce>,
    events: Vec<Event>,
}

/// A body's solver and what it reported.
struct Worker {
    body: usize,
    /// The body that the solver was made for.
    of: Body,
    integrator: Box<dyn Integrator>,
    reaction: Reaction,
    untangler: Untangler,
    before: BodyState,
    state: BodyState,
    report: StepReport,
}

impl Stepper {
    /// Prepares to step frames of `dt` [s] by `schedule` with `threads` worker threads (0: as many as the machine has). The result does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// A schedule or `dt` that cannot be, or threads that the system does not give.
    pub fn new(model: &Model, schedule: Schedule, dt: f64, threads: usize) -> Result<Self> {
        if !(dt > 0.0 && dt <= 10.0) {
            return Err(Error::Model(format!("a frame of {dt} s; above 0 and at most 10 s make sense")));
        }
        schedule.check()?;
        let mut stepper =
            Self { dt, schedule, threads, pool: None, workers: Vec::new(), forces: Vec::new(), events: Vec::new() };
        stepper.follow(model)?;
        Ok(stepper)
    }

    /// Goes over to another `model`, such as that of before or after a cut ([`crate::sever`]). What both have in common keeps its solver; only the other bodies are prepared. States
    /// of the new model go on with the same bits as in a new stepper.
    ///
    /// # Errors
    /// Threads that the system does not give; the stepper still steps the old model then.
    pub fn follow(&mut self, model: &Model) -> Result<()> {
        // Handing a small model over to a pool of one would cost more than some frames do, and bodies are all that the quasi-Newton solver shares out among threads.
        let one = matches!(self.schedule, Schedule::QuasiNewton(_)) && model.bodies.len() == 1;
        let alone = self.threads == 1 || one;
        if alone {
            self.pool = None;
        } else if self.pool.is_none() {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
            self.pool =
                Some(pool.map_err(|e| Error::Model(format!("{} threads cannot be started: {e}", self.threads)))?);
        }
        let mut old = std::mem::take(&mut self.workers);
        for (index, (state, body)) in State::new(model).bodies.into_iter().zip(&model.bodies).enumerate() {
            let worker = match old.iter().position(|worker| worker.of.is(body)) {
                Some(at) => Worker { body: index, ..old.swap_remove(at) },
                None => Worker {
                    body: index,
                    of: body.clone(),
                    integrator: integrator(&self.schedule, body, self.dt, alone),
                    reaction: Reaction::new(body),
                    untangler: Untangler::new(&state),
                    before: state.clone(),
                    state,
                    report: StepReport::default(),
                },
            };
            self.workers.push(worker);
        }
        self.workers.sort_by_key(|worker| std::cmp::Reverse(model.bodies[worker.body].tets.len()));
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

    /// Advances `state` by one frame. `tools` are the motions of the tools that carry the state's grasps; what is held by a tool without a motion stays where it is.
    pub fn step(&mut self, model: &Model, state: &mut State, tools: &[ToolMotion]) -> StepReport {
        self.events.clear();
        self.forces.clear();
        let nodes = |worker: &Worker| state.bodies.get(worker.body).map(|body| body.x.len());
        let known = |worker: &Worker| Some(worker.state.x.len());
        let same = self.workers.len() == model.bodies.len() && self.workers.len() == state.bodies.len();
        // A model that was built again is as good as the same; one that was cut elsewhere is not.
        let other = |w: &Worker| !model.bodies[w.body].is_alike(&w.of);
        if !same || !state.grasps_fit(model) || self.workers.iter().any(|w| nodes(w) != known(w) || other(w)) {
            return StepReport { divergence: Some(Divergence::OtherModel), ..StepReport::default() };
        }
        for worker in &mut self.workers {
            std::mem::swap(&mut worker.state, &mut state.bodies[worker.body]);
        }
        let (dt, gravity, grasps, colliders) = (self.dt, model.gravity, &state.grasps[..], &model.colliders[..]);
        let workers = &mut self.workers;
        let advance = |worker: &mut Worker| {
            let frame = Frame { dt, gravity, index: worker.body, grasps, tools, colliders };
            worker.advance(&frame, &model.bodies[worker.body]);
        };
        match &self.pool {
            Some(pool) => pool.install(|| workers.par_iter_mut().with_max_len(1).for_each(advance)),
            None => workers.iter_mut().for_each(advance),
        }
        let report = self.workers.iter().fold(StepReport::default(), |all, worker| all.with(&worker.report));
        let lost = |worker: &Worker| matches!(worker.report.divergence, Some(Divergence::NonFinite { .. }));
        let broken = self.workers.iter().any(lost);
        for worker in &mut self.workers {
            // The whole state is of one instant: if a body is lost, all are put back.
            if broken {
                worker.state.copy_from(&worker.before);
            }
            std::mem::swap(&mut worker.state, &mut state.bodies[worker.body]);
        }
        if !broken {
            state.time += dt;
            self.tell_tools(state, tools.len());
        }
        report
    }

    /// Sums up what the bodies did to the tools, and lets grasps slip and tear.
    fn tell_tools(&mut self, state: &mut State, tools: usize) {
        self.forces.clear();
        self.forces.resize(tools, ToolForce::default());
        for worker in &self.workers {
            self.forces.iter_mut().zip(worker.reaction.forces()).for_each(|(sum, part)| sum.add(part));
            let Some(contacts) = worker.integrator.contacts() else { continue };
            self.forces.iter_mut().zip(contacts.forces()).for_each(|(sum, part)| sum.add(part));
            for held in contacts.hanging() {
                state.grasps[held.grasp as usize].slid[held.node as usize] = held.slid;
            }
        }
        for (g, grasp) in state.grasps.iter_mut().enumerate() {
            let body = grasp.body;
            let workers = self.workers.iter().filter(|worker| worker.body == body);
            let contacts = workers.filter_map(|worker| worker.integrator.contacts());
            let held = contacts.flat_map(|contacts| contacts.hanging()).filter(|held| held.grasp as usize == g);
            grasp.judge(held, &mut self.events);
        }
    }
}

impl Worker {
    fn advance(&mut self, frame: &Frame<'_>, body: &Body) {
        self.report = StepReport::default();
        self.before.copy_from(&self.state);
        self.untangler.untangle(frame, body, &mut self.state);
        self.integrator.advance(frame, body, &mut self.state, &mut self.report);
        self.report.measure(frame.index, body, &self.state);
        self.reaction.take(frame, body, &self.state, self.integrator.contacts().is_none());
    }
}

/// The schedule's solver for a body.
fn integrator(schedule: &Schedule, body: &Body, dt: f64, alone: bool) -> Box<dyn Integrator> {
    let sweeps = |descent: Descent| Box::new(TouchingDescent::new(descent, body, alone));
    match schedule {
        Schedule::QuasiNewton(method) => match QuasiNewtonIntegrator::new(*method, body, dt, alone) {
            Some(integrator) => Box::new(integrator),
            // Every node is pinned, or the matrix cannot be factorised: sweeps need no matrix.
            None => {
                sweeps(Descent { substeps: method.substeps, iterations: method.iterations, start: Start::Adaptive })
            }
        },
        Schedule::Descent(descent) => sweeps(*descent),
        Schedule::SemiImplicit(settings) => Box::new(ComparatorIntegrator::semi_implicit(*settings, body)),
        Schedule::Xpbd(settings) => Box::new(ComparatorIntegrator::xpbd(*settings, body)),
        Schedule::Newton(settings) => Box::new(NewtonIntegrator::new(*settings, body)),
    }
}
