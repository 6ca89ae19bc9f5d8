//! One frame of simulation, stage by stage.

use crate::contact::ToolGroup;
use crate::descent::TouchingDescent;
use crate::external::{ExternalSolver, Integrator};
use crate::frame::Frame;
use crate::lattice::LatticeSolver;
use crate::quasi_newton::QuasiNewtonSolver;
use crate::report::Divergence;
use crate::solver_set::{BodySolvers, SolverSet};
use crate::{
    Backend, Body, Error, Event, Load, Model, Result, SolverSettings, State, StepReport, ToolForce, ToolMotion,
};
use glam::DVec3;

/// A single body of fewer nodes is stepped on one thread: handing a small model to a pool costs
/// more than a frame.
const MIN_THREADED_NODES: usize = 4000;

/// Advances states of one model.
///
/// It owns all scratch memory: stepping allocates nothing but lists of contacts that become longer
/// than before, and, on several threads, small tasks that keep the others awake.
///
/// ```
/// use trocar_tissue::{ModelBuilder, SolverSettings, State, Stepper};
/// # use glam::DVec3;
/// # use trocar_tissue::{BodyDescription, ConstitutiveModel::StableNeoHookean, Material};
/// # let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// # let mesh = &trocar_geometry::TetMesh { vertices: corners.map(|p| 0.01 * p).to_vec(), tets: vec![[0, 1, 2, 3]] };
/// # let material = Material { model: StableNeoHookean, young_modulus: 5e3, poisson_ratio: 0.45, density: 1050.0, viscosity: 5.0 };
/// # let mut builder = ModelBuilder::new().gravity(DVec3::Z * 9.81);
/// # builder.body(BodyDescription { name: "organ".to_owned(), mesh, material, pinned: vec![0, 1, 2], supports: vec![] })?;
///
/// let model = builder.build()?;
/// let mut state = State::new(&model);
/// let mut stepper = Stepper::new(&model, SolverSettings::default(), 1.0 / 60.0, 1)?;
/// let start = state.clone();
/// let report = stepper.step(&model, &mut state, &[]);
/// assert!(report.divergence.is_none() && state.hash() != start.hash());
/// // The same state gives the same step, bit by bit.
/// let mut again = start;
/// stepper.step(&model, &mut again, &[]);
/// assert_eq!(again.hash(), state.hash());
/// # Ok::<(), trocar_tissue::Error>(())
/// ```
pub struct Stepper {
    dt: f64,
    /// Whether a single body of any size is worth several threads.
    threaded_bodies: bool,
    threads: usize,
    /// None: the calling thread does the work.
    pool: Option<rayon::ThreadPool>,
    solvers: Box<dyn SolverSet>,
    backend: Backend,
    forces: Vec<ToolForce>,
    events: Vec<Event>,
}

impl Stepper {
    /// Prepares to step frames of `dt` (s) with `threads` worker threads (0: one for each core).
    /// The results do not depend on the number of threads.
    ///
    /// # Errors
    /// Settings or a `dt` out of range, or threads that the system refuses.
    pub fn new(model: &Model, settings: SolverSettings, dt: f64, threads: usize) -> Result<Self> {
        settings.check()?;
        let threaded_bodies = matches!(settings, SolverSettings::Descent(_));
        Self::with_solvers(model, solvers(model.backend, settings, dt), threaded_bodies, dt, threads)
    }

    /// Prepares to step with an integrator from outside this crate: `make` makes the one of each
    /// body. Bodies then pass through each other and through tools.
    ///
    /// # Errors
    /// A `dt` out of range, or threads that the system refuses.
    pub fn with_integrator(
        model: &Model,
        make: impl Fn(&Body) -> Box<dyn Integrator> + Send + Sync + 'static,
        dt: f64,
        threads: usize,
    ) -> Result<Self> {
        let solvers = BodySolvers::new(move |body, _| ExternalSolver::new(make(body)));
        Self::with_solvers(model, Box::new(solvers), false, dt, threads)
    }

    /// Another stepper with the same settings, for `model`: a state gets the same bits from both.
    /// Forces and events of the last frame are not copied.
    ///
    /// # Errors
    /// A model of another backend, and threads that the system refuses.
    pub fn another(&self, model: &Model) -> Result<Self> {
        let mut made = Self {
            dt: self.dt,
            threaded_bodies: self.threaded_bodies,
            threads: self.threads,
            pool: None,
            solvers: self.solvers.another(),
            backend: self.backend,
            forces: Vec::new(),
            events: Vec::new(),
        };
        made.set_model(model)?;
        Ok(made)
    }

    fn with_solvers(
        model: &Model,
        solvers: Box<dyn SolverSet>,
        threaded_bodies: bool,
        dt: f64,
        threads: usize,
    ) -> Result<Self> {
        if !(dt > 0.0 && dt <= 10.0) {
            return Err(Error::Model(format!("a frame of {dt} s; must be in (0, 10]")));
        }
        let (forces, events) = (Vec::new(), Vec::new());
        let backend = model.backend;
        let mut stepper = Self { dt, threaded_bodies, threads, pool: None, solvers, backend, forces, events };
        stepper.set_model(model)?;
        Ok(stepper)
    }

    /// Changes to another `model`, such as the one before or after a cut ([`crate::sever`]).
    ///
    /// Bodies that both models have in common keep their solvers; only the others are prepared.
    /// Where bodies touch, all pairs are measured at rest again. A state of the new model continues
    /// with the same bits as in a new stepper.
    ///
    /// # Errors
    /// A model of another backend, and threads that the system refuses; the stepper then still
    /// steps the old model.
    pub fn set_model(&mut self, model: &Model) -> Result<()> {
        if self.backend != model.backend {
            return Err(Error::Model(
                "the model has another backend than the stepper's; make another stepper".to_owned(),
            ));
        }
        let is_small = |body: &Body| !self.threaded_bodies && body.len() < MIN_THREADED_NODES;
        let single_body = model.bodies.len() == 1 && model.bodies.iter().all(is_small);
        let single_thread = self.threads == 1 || single_body;
        if single_thread {
            self.pool = None;
        } else if self.pool.is_none() {
            self.pool = Some(trocar_core::thread_pool(self.threads).map_err(Error::Model)?);
        }
        match &self.pool {
            Some(pool) => pool.install(|| self.solvers.set_model(model, single_thread)),
            None => self.solvers.set_model(model, single_thread),
        }
        Ok(())
    }

    /// Advances `state` by one frame. `tools` are the motions of the tools that carry the state's
    /// grasps. Nodes that are held by a tool without a motion stay where they are.
    pub fn step(&mut self, model: &Model, state: &mut State, tools: &[ToolMotion]) -> StepReport {
        self.step_with_loads(model, state, tools, &[])
    }

    /// [`Self::step`] with `loads` on nodes.
    pub fn step_with_loads(
        &mut self,
        model: &Model,
        state: &mut State,
        tools: &[ToolMotion],
        loads: &[Load],
    ) -> StepReport {
        self.forces.clear();
        self.events.clear();
        if let Some(why) = self.refusal(model, state, loads) {
            return StepReport { divergence: Some(why), ..StepReport::default() };
        }
        let (grasps, holes) = (std::mem::take(&mut state.grasps), std::mem::take(&mut state.holes));
        let (dt, gravity) = (self.dt, model.gravity);
        let (colliders, tool_contact) = (&model.colliders[..], model.tool_contact);
        let single_thread = self.pool.is_none();
        let frame = Frame {
            dt,
            gravity,
            index: 0,
            grasps: &grasps,
            holes: &holes,
            tools,
            loads,
            colliders,
            tool_contact,
            single_thread,
        };

        self.solvers.begin_frame(state, &frame);
        self.solvers.build_islands(model, state, &frame);
        self.solvers.solve_islands(state, &frame, self.pool.as_ref());
        let report = self.solvers.end_frame(state);

        (state.grasps, state.holes) = (grasps, holes);
        if !matches!(report.divergence, Some(Divergence::NonFinite { .. })) {
            state.time += dt;
            self.sum_tool_forces(tools.len());
            self.update_grasps(state);
        }
        report
    }

    /// Why a frame cannot be stepped, if it cannot.
    fn refusal(&self, model: &Model, state: &State, loads: &[Load]) -> Option<Divergence> {
        if !self.solvers.fits(model, state) || !state.names_nodes_of(model) {
            return Some(Divergence::OtherModel);
        }
        (!loads.iter().all(|load| load.fits(model))).then_some(Divergence::WrongLoad)
    }

    /// Sums up the forces of the bodies on each of so many tools.
    fn sum_tool_forces(&mut self, tools: usize) {
        let Self { solvers, forces, .. } = self;
        forces.resize(tools, ToolForce::default());
        solvers.for_bodies(&mut |_, reaction, contacts| {
            let contacts = contacts.map_or(&[][..], |contacts| contacts.forces());
            for part in [reaction.forces(), contacts] {
                forces.iter_mut().zip(part).for_each(|(sum, part)| sum.add(part));
            }
        });
    }

    /// Updates slip and tearing of grasps from their nodes in the last substep.
    fn update_grasps(&mut self, state: &mut State) {
        let Self { solvers, events, .. } = self;
        solvers.for_bodies(&mut |_, _, contacts| {
            for node in contacts.map_or(&[][..], |contacts| contacts.compliant()) {
                state.grasps[node.grasp as usize].slid[node.node as usize] = node.slid;
            }
        });
        for (g, grasp) in state.grasps.iter_mut().enumerate() {
            solvers.for_bodies(&mut |body, _, contacts| {
                if let Some(contacts) = contacts.filter(|_| body == grasp.body) {
                    grasp.update(contacts.compliant().iter().filter(|node| node.grasp as usize == g), events);
                }
            });
        }
    }

    /// Forces of tissue on each tool in the last frame, in the order of the motions of the step.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// Force of one body on a tool in the last frame; zero before the first one.
    pub fn force_of(&self, body: usize, tool: usize) -> ToolForce {
        let mut sum = ToolForce::default();
        self.solvers.for_bodies(&mut |index, reaction, contacts| {
            let contacts = contacts.filter(|_| index == body).map_or(&[][..], |contacts| contacts.forces());
            let constraints = if index == body { reaction.forces() } else { &[] };
            for part in [constraints, contacts] {
                part.get(tool).into_iter().for_each(|force| sum.add(force));
            }
        });
        sum
    }

    /// How the force of tissue on `tools` changes when they move together, as one rigid body: about
    /// the point `about` (m), the wrench on them (N, N m) changes by minus this matrix times the
    /// motion (translation (m), rotation vector (rad)) of a frame.
    ///
    /// It is linearised at the end of the last frame, which left `state`, with elements as stiff as
    /// at rest. Masses and dashpots resist the motion: tissue that settles is softer. Left out are
    /// rigid grasps, and how present forces turn with the tools. It is symmetric, and positive
    /// semidefinite up to rounding. The cost is six solves a substep for each body that is touched,
    /// and some ten times as many where tissue slips along the tools. The next frame has the same
    /// bits with and without it.
    ///
    /// Zero with solvers other than [`SolverSettings::QuasiNewton`], which have no matrix.
    pub fn tool_stiffness(&mut self, model: &Model, state: &State, tools: &[usize], about: DVec3) -> [[f64; 6]; 6] {
        let mut sum = [[0.0; 6]; 6];
        if self.solvers.fits(model, state) && state.names_nodes_of(model) {
            let group = ToolGroup { dt: self.dt, tools, about, grasps: &state.grasps, colliders: &model.colliders };
            self.solvers.add_tool_stiffness(&group, &mut sum);
        }
        // Rounding makes it slightly unsymmetric.
        std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (sum[i][j] + sum[j][i])))
    }

    /// Events of grasps in the last frame.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Forces of tools and other bodies on nodes at the end of the last frame, which left `state`.
    ///
    /// As loads throughout a frame that ends there, they have the same effect. Supports and grasps
    /// are not included.
    pub fn contact_loads(&self, model: &Model, state: &State) -> Vec<Load> {
        let mut forces: Vec<(usize, u32, DVec3)> = Vec::new();
        if self.solvers.fits(model, state) {
            self.solvers.for_contact_forces(state, &mut |body, vertex, force| forces.push((body, vertex, force)));
        }
        let nodes: Vec<Vec<usize>> = model.bodies.iter().map(Body::nodes_of_vertices).collect();
        let load = |(body, vertex, force): (usize, u32, DVec3)| {
            let node = nodes[body][vertex as usize];
            Load { body, node, force }
        };
        forces.into_iter().map(load).collect()
    }
}

/// The solvers of these settings. Those of lattices are one method, which takes substeps and
/// tolerances from them.
fn solvers(backend: Backend, settings: SolverSettings, dt: f64) -> Box<dyn SolverSet> {
    if let Backend::Lattice(_) = backend {
        return Box::new(BodySolvers::new(move |body, _| LatticeSolver::new(settings, body)));
    }
    match settings {
        SolverSettings::QuasiNewton(method) => Box::new(BodySolvers::new(move |body, single_thread| {
            QuasiNewtonSolver::new(method, body, dt, single_thread)
        })),
        SolverSettings::Descent(descent) => {
            Box::new(BodySolvers::new(move |body, single_thread| TouchingDescent::new(descent, body, single_thread)))
        }
    }
}
