//! The oracle: implicit Euler's step and the static equilibrium in double precision, converged.
//!
//! The solvers of `trocar-tissue` minimise the same function of the free nodes' positions x,
//!
//! 1/(2 dt^2) |x - y|_M^2 + sum V0 Psi(F) + dashpots + support planes, y = x0 + dt v0 + dt^2 g,
//!
//! and are judged by how near they come to the oracle, which finds the minimum by Newton's method
//! with a sparse direct solve. It is slow and meant for tests and studies. The function contains:
//!
//! - energies, stresses and their derivatives of [`trocar_tissue::Hyperelastic`]; masses, dashpots
//!   and contact stiffness as the model holds them (rounded to `f32`);
//! - dashpots as the sweeps have them: quadratic in the change of an edge's squared length since
//!   the beginning of the step, so that no rigid motion meets them;
//! - the supports' one-sided quadratic penalty;
//! - contact with tools and between bodies at the present distances and normals, where the fast
//!   solvers hold a plane during a substep;
//! - threads from nodes to fixed points, if there are any;
//! - pinned nodes stay; held nodes are prescribed. The stepper's rules for nodes that cannot follow
//!   a tool are left out: a motion that cannot be followed is an error.
//!
//! Two quantities have no potential: friction, because its limit grows with the depth, and the
//! stiffness of an edge that touches a tool, because it depends on the place of the contact. So the
//! function is minimised with both fixed. Then they are updated, until the forces of the true law
//! are in balance.
//!
//! The minimum is that of the steps of `SolverSettings::PAPER`. The default solver steps a body in
//! free flight exactly, the oracle by implicit Euler.
//!
//! All work is done on the calling thread in a fixed order: the same machine gives the same bits.

mod contact;
pub(crate) mod element;
pub(crate) mod factor;
mod guard;
mod integrator;
mod newton;
mod potential;
mod rounds;
mod rub;
mod solution;
mod state;
#[cfg(test)]
mod tests;
mod tether;

pub use integrator::{Newton, NewtonIntegrator};
pub use potential::elastic_energy;
pub use solution::{Failure, Precision, Solution};
pub use state::{Held, OracleState};

use crate::{Error, Result};
use contact::{Contacts, Touching};
use glam::DVec3;
use newton::Solver;
use potential::{Elastic, Motion, Potential};
use state::{Nodes, Stretches};
use std::ops::Range;
use trocar_core::Pose;
use trocar_tissue::{Body, Model, Tether, ToolForce, ToolMotion};

/// Finds converged steps and equilibria of one model. It keeps the symbolic factorisations from
/// step to step while the same nodes are held.
///
/// ```
/// use glam::DVec3;
/// use trocar_testing::blocks::{block, model, nodes, tissue};
/// use trocar_tissue_reference::{Oracle, OracleState};
///
/// // A bar of 40 mm that hangs from one end.
/// let mesh = block([4, 1, 1], 0.01);
/// let held = nodes(&mesh, |p| p.x < 1e-6);
/// let model = model(&mesh, tissue(10e3), held, DVec3::Z * -9.81);
/// let mut state = OracleState::new(&model);
/// let found = Oracle::new(&model).settle(&model, &mut state, &[])?;
/// assert_eq!(found.len(), 1, "one body");
/// assert!(state.positions(0).iter().any(|p| p.z < -1e-4), "it sags");
/// # Ok::<(), trocar_tissue_reference::Error>(())
/// ```
pub struct Oracle {
    groups: Vec<Group>,
    forces: Vec<ToolForce>,
    pushes: Vec<DVec3>,
}

/// Bodies that are solved together: one, or all if bodies touch each other.
struct Group {
    bodies: Range<usize>,
    /// Number of nodes of each body.
    lengths: Vec<usize>,
    elastic: Elastic,
    solver: Solver,
    touching: Touching,
    /// The threads of its bodies. Nodes are counted among those of the group.
    tethers: Vec<Tether>,
}

/// The outcome of a group's solve, before anything is written.
struct Solved {
    x: Vec<DVec3>,
    fixed: Vec<bool>,
    anchors: Vec<Option<DVec3>>,
    stretches: Stretches,
    forces: Vec<ToolForce>,
    /// Force of all contacts on each node (N).
    pushes: Vec<DVec3>,
    solution: Solution,
}

impl Oracle {
    /// Prepares for `model`, with [`Precision::default`].
    pub fn new(model: &Model) -> Self {
        Self::with_precision(model, Precision::default())
    }

    /// Prepares for `model`.
    pub fn with_precision(model: &Model, precision: Precision) -> Self {
        let all = 0..model.bodies().len();
        let groups = if model.body_contact().is_some() { vec![all] } else { all.map(|b| b..b + 1).collect() };
        let prepare = |bodies: Range<usize>| {
            let elastic = Elastic::of(&model.bodies()[bodies.clone()]);
            let solver = Solver::of(&elastic, precision);
            let lengths = model.bodies()[bodies.clone()].iter().map(Body::len).collect();
            let touching = Touching::new(model, bodies.clone());
            let tethers = tethers(&model.bodies()[bodies.clone()]);
            Group { touching, bodies, lengths, elastic, solver, tethers }
        };
        Self { groups: groups.into_iter().map(prepare).collect(), forces: Vec::new(), pushes: Vec::new() }
    }

    /// Advances `state` by one step of implicit Euler of length `dt` (s), the counterpart of one
    /// *substep* of the stepper, without tools. Held nodes end at their targets without velocity.
    /// Returns how each body's minimum was found.
    ///
    /// # Errors
    /// A body whose minimum was not found, by name; a `dt`, state or target that is not valid. The
    /// state is then as it was.
    pub fn step(&mut self, model: &Model, state: &mut OracleState, dt: f64, held: &[Held]) -> Result<Vec<Solution>> {
        self.step_with_tools(model, state, dt, held, &[])
    }

    /// [`Self::step`] with the motions of `tools`, by index; a collider whose tool has none is
    /// absent.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub fn step_with_tools(
        &mut self,
        model: &Model,
        state: &mut OracleState,
        dt: f64,
        held: &[Held],
        tools: &[ToolMotion],
    ) -> Result<Vec<Solution>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("a step of {dt} s; it must be above 0")));
        }
        let solutions = self.solve(model, state, held, tools, Some(dt))?;
        state.time += dt;
        Ok(solutions)
    }

    /// Moves `state` to the static equilibrium near it, without tools: the step for an infinite
    /// `dt`, without inertia, dashpots and friction. Velocities become 0.
    ///
    /// # Errors
    /// As [`Self::step`]; also a body that gravity acts on and nothing holds.
    pub fn settle(&mut self, model: &Model, state: &mut OracleState, held: &[Held]) -> Result<Vec<Solution>> {
        self.settle_with_tools(model, state, held, &[])
    }

    /// [`Self::settle`] with `tools` at these poses.
    ///
    /// # Errors
    /// As [`Self::settle`].
    pub fn settle_with_tools(
        &mut self,
        model: &Model,
        state: &mut OracleState,
        held: &[Held],
        tools: &[Pose],
    ) -> Result<Vec<Solution>> {
        let tools: Vec<ToolMotion> = tools.iter().map(|pose| ToolMotion { from: *pose, to: *pose }).collect();
        self.solve(model, state, held, &tools, None)
    }

    /// Forces of tissue on each tool at the end of the last step, by contact alone.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// Force of tools and other bodies on each body at the end of the last step (N), supports left
    /// out.
    pub fn pushes(&self) -> &[DVec3] {
        &self.pushes
    }

    /// The incremental potential of each body (J) of a step of `dt` (s) from `before` that ends
    /// with the positions of `after`: the function that [`Self::step`] minimises over free nodes,
    /// without friction. It is not finite where an element has no volume. Only differences have a
    /// meaning. Bodies that may touch each other have one together, without their contact.
    ///
    /// # Errors
    /// States of another model or that are not finite; a `dt` that is not above 0.
    pub fn energy(&self, model: &Model, before: &OracleState, after: &OracleState, dt: f64) -> Result<Vec<f64>> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("a step of {dt} s; it must be above 0")));
        }
        before.check(model, &[])?;
        after.check(model, &[])?;
        self.check(model)?;
        let of_group = |group: &Group| {
            let elastic = &group.elastic;
            let before = Nodes::joined(&before.bodies[group.bodies.clone()]);
            let after = Nodes::joined(&after.bodies[group.bodies.clone()]);
            let motion = Some(Motion::new(elastic, &before, model.gravity(), dt));
            let potential = Potential {
                elastic,
                motion,
                gravity: model.gravity(),
                limits: Vec::new(),
                contacts: None,
                tethers: &group.tethers,
            };
            potential.gradient(&after.x, &mut vec![DVec3::ZERO; after.x.len()])
        };
        Ok(self.groups.iter().map(of_group).collect())
    }

    /// Refuses another model than it was prepared for, and surfaces that it does not know.
    fn check(&self, model: &Model) -> Result<()> {
        if let Some(body) = model.bodies().iter().find(|body| body.collision_surface().is_some()) {
            return Err(Error::Invalid(format!(
                "body '{}' has a collision surface of its own; the oracle judges contact of the elements' boundary",
                body.name()
            )));
        }
        let lengths = self.groups.iter().flat_map(|group| group.lengths.iter().copied());
        if lengths.eq(model.bodies().iter().map(Body::len)) {
            Ok(())
        } else {
            Err(Error::Invalid("the oracle was prepared for another model".to_owned()))
        }
    }

    fn solve(
        &mut self,
        model: &Model,
        state: &mut OracleState,
        held: &[Held],
        tools: &[ToolMotion],
        dt: Option<f64>,
    ) -> Result<Vec<Solution>> {
        state.check(model, held)?;
        self.check(model)?;
        let mut solved = Vec::with_capacity(self.groups.len());
        for group in &mut self.groups {
            solved.push(group.solve(model, state, held, tools, dt)?);
        }
        self.forces.clear();
        self.forces.resize(tools.len(), ToolForce::default());
        self.pushes.clear();
        state.stretches.clear();
        let mut solutions = Vec::with_capacity(state.bodies.len());
        for (group, mut solved) in self.groups.iter().zip(solved) {
            let (mut first, mut anchor) = (0, 0);
            for body in &mut state.bodies[group.bodies.clone()] {
                let range = first..first + body.x.len();
                for (i, v) in range.clone().zip(&mut body.v) {
                    *v = match dt {
                        Some(dt) if !solved.fixed[i] => (solved.x[i] - body.x[i - first]) / dt,
                        _ => DVec3::ZERO,
                    };
                }
                body.x.copy_from_slice(&solved.x[range.clone()]);
                // As many as the body has supports and nodes; none in statics.
                let anchors = model.bodies()[solutions.len()].supports().len() * body.x.len();
                let end = (anchor + anchors).min(solved.anchors.len());
                body.anchors = solved.anchors[anchor..end].to_vec();
                self.pushes.push(solved.pushes[range.clone()].iter().sum());
                (first, anchor) = (range.end, end);
                solutions.push(solved.solution);
            }
            state.stretches.append(&mut solved.stretches);
            self.forces.iter_mut().zip(&solved.forces).for_each(|(sum, part)| sum.add(part));
        }
        Ok(solutions)
    }
}

/// The threads of bodies, whose nodes follow each other.
fn tethers(bodies: &[Body]) -> Vec<Tether> {
    let (mut first, mut all) = (0, Vec::new());
    for body in bodies {
        all.extend(body.tethers().iter().map(|t| Tether { node: t.node + first, ..*t }));
        first += body.len() as u32;
    }
    all
}

impl Group {
    fn solve(
        &mut self,
        model: &Model,
        state: &OracleState,
        held: &[Held],
        tools: &[ToolMotion],
        dt: Option<f64>,
    ) -> Result<Solved> {
        let bodies = &model.bodies()[self.bodies.clone()];
        let before = Nodes::joined(&state.bodies[self.bodies.clone()]);
        let mut fixed: Vec<bool> = bodies.iter().flat_map(|body| body.pinned().iter().copied()).collect();
        let mut targets = before.x.clone();
        for h in held.iter().filter(|h| self.bodies.contains(&h.body)) {
            let (body, node) = (h.body - self.bodies.start, h.node as usize);
            if !bodies[body].pinned()[node] {
                let i = self.lengths[..body].iter().sum::<usize>() + node;
                (fixed[i], targets[i]) = (true, h.target);
            }
        }
        let names: Vec<&str> = bodies.iter().map(Body::name).collect();
        let named = |failure| Error::Unsolved { body: names.join("', '"), failure };
        let lies = bodies.iter().any(|body| !body.supports().is_empty());
        let tied = !self.tethers.is_empty();
        if dt.is_none() && model.gravity() != DVec3::ZERO && !lies && !tied && !fixed.contains(&true) {
            return Err(named(Failure::Unheld));
        }
        let Self { elastic, solver, touching, tethers, .. } = self;
        let motion = dt.map(|dt| Motion::new(elastic, &before, model.gravity(), dt));
        let start = dt.map(|_| (&before.x[..], &state.stretches));
        let touches = model.body_contact().is_some() || (!model.colliders().is_empty() && !tools.is_empty());
        let contacts = touches.then(|| Contacts::new(touching, &elastic.contact_stiffness, &fixed, tools, start));
        let mut potential =
            Potential { elastic, motion, gravity: model.gravity(), limits: Vec::new(), contacts, tethers };
        let mut x = before.x.clone();
        let solution = rounds::minimise(solver, &mut potential, &fixed, &targets, &before.v, &mut x).map_err(named)?;
        let mut forces = vec![ToolForce::default(); tools.len()];
        let mut stretches = Stretches::new();
        let mut pushes = vec![DVec3::ZERO; x.len()];
        if let Some(contacts) = &potential.contacts {
            contacts.add_forces(&x, &mut forces);
            contacts.gradient(&x, |i, gradient| pushes[i] -= gradient);
            if dt.is_some() {
                stretches = contacts.stretches(&x);
            }
        }
        let anchors = potential.anchors(&x);
        Ok(Solved { x, fixed: fixed.clone(), anchors, stretches, forces, pushes, solution })
    }
}
